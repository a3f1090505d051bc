"""Compile a Python function to hardware: front, graph, schedule, binding, text."""
