"""The link to the board: frames in, commands out, each carried out once.

`engine` holds the rules and does no input or output. `session` runs it over a
`transport`: a serial port, a simulated board, or a lossy wrapper around either.
"""
