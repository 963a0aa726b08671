"""`detent` and `python -m detent`: how a command ends that is interrupted before anything of it is imported."""

import os
import signal


def main() -> None:
    """Entry point."""
    for number in (signal.SIGINT, signal.SIGTERM):
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, _leave)
    # The matrices here are small: on a busy machine a second thread waits a hundred times longer than it works.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    from detent import cli
    from detent.cli.terminal import heed_signals

    heed_signals()
    cli.main()


def _leave(number: int, _frame: object) -> None:
    os.write(2, b"Interrupted; no file was written or changed.\n")
    os._exit(128 + number)


if __name__ == "__main__":
    main()
