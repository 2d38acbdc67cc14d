"""`python -m nmm`: the command line."""

from nmm.cli import main

if __name__ == "__main__":
    main()
