"""The command `flexspline`, which `python -m flexspline` is too."""

import sys


def main() -> None:
    """Run the command line; an interrupt while it is imported ends as one later does."""
    try:
        from flexspline.cli import main as run
    except KeyboardInterrupt:
        sys.stderr.write("flexspline: interrupted; nothing was written\n")
        sys.exit(130)
    run()


if __name__ == "__main__":
    main()
