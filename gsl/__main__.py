"""The command line from its first line on: an interruption ends it quietly before anything else is loaded."""

import os
import signal

INTERRUPTED = 130  # as in gsl.commandline.failure, which is not loaded yet


def main() -> None:
    """Run the command line of this process."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, _leave)
    from gsl.cli import main as run

    run()


def _leave(number: int, frame: object) -> None:
    os.write(2, b"gsl: interrupted before it began\n")
    os._exit(INTERRUPTED)  # without the ends of imports that are under way


if __name__ == "__main__":
    main()
