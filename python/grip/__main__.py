"""The command ``grip``, as ``grip`` or ``python -m grip``."""

import signal
import sys

from . import _grip


def main() -> int:
    # The command hears Ctrl-C itself: it says what is kept, and ends the process.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    return _grip.main(sys.argv[1:])


if __name__ == "__main__":
    sys.exit(main())
