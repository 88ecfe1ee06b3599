"""``python -m trajopt``: the command line."""

from trajopt.cli import main

main()
