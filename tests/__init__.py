"""Tests: unit mirrors src, property: for every input, acceptance: the specifications, docs: the pages, bench: speed."""
