"""`python -m flexspline.cli` is `flexspline`."""

from flexspline.cli import main

main()
