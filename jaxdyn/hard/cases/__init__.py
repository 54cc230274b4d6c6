"""The hard cases, a file for each topic; each offers its own as ``CASES``."""
