"""A page in the browser that draws, edits and checks a system; the specification's file remains the only source."""
