"""The hard cases, in one file for each topic; each file has its cases as ``CASES``."""
