"""Turns the schema into files: one module for each kind of file."""
