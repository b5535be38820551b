"""`python -m setae.cli`."""

from setae.cli import main

main()
