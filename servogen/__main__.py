"""`python -m servogen` is the command `servogen`."""

from servogen.cli import main

if __name__ == "__main__":
    main()
