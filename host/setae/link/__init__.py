"""The link to the board: frames in, commands out, each carried out once.

`engine` puts the rules together, one module each, and does no input or output:
start there. `session` runs it over a `transport`: a serial port, a simulated
board, or a lossy wrapper around either.
"""
