"""``python -m geomotion_cli ncds train …``, for machines without the scripts on their path."""

import sys

from geomotion_cli.dispatch import main
from geomotion_cli.verbs import PROGRAMS

if __name__ == "__main__":
    program, *arguments = sys.argv[1:] or [""]
    if program not in PROGRAMS:
        sys.exit(f"usage: python -m geomotion_cli {{{','.join(PROGRAMS)}}} VERB [key=value …]")
    sys.exit(main(program, arguments))
