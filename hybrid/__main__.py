"""`python -m hybrid`: the command `hybrid` of this interpreter."""

from hybrid.cli.commands import main

if __name__ == "__main__":
    main()
