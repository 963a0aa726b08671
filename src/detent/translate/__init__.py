"""Steps of Python as C99: types and intervals, statements, expressions, text.

| file | what |
|---|---|
| `values` | what is known of an expression: its text in C, its type, the interval of an integer |
| `known` | what a condition, or a store, says of the values behind it |
| `integers` | operators of integers, in 32 bits where the intervals fit, else in 64 |
| `expressions`, `calls` | everything that has a value |
| `statements` | everything else |
| `program` | all steps that some entries reach, to a fixed point of their intervals; callees first |
| `text` | structures, helpers, and the two files |
"""
