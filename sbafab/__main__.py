"""``python -m sbafab``: the command where no script of it is on the path."""

from sbafab.entry import main

if __name__ == "__main__":
    main()
