"""`python -m flexspline` is the command `flexspline`."""

from flexspline.cli import main

main()
