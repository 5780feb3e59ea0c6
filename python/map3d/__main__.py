"""`python -m map3d`: the command line."""

from map3d.cli import main

if __name__ == "__main__":
    main()
