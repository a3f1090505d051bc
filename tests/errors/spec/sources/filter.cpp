// A source file that is there; nothing looks into it.
