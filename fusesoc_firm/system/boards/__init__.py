"""Boards, and the top level that fits a system on one."""
