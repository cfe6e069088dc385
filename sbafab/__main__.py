"""``python -m sbafab``: the command without its script on the path."""

from sbafab.entry import main

if __name__ == "__main__":
    main()
