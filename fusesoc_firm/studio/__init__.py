"""A page in the browser that draws, edits and checks a system; the specification's file stays the truth."""
