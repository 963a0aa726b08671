"""A face as a process: it reads what it is told on its standard input, and ends when that closes."""

import asyncio
import contextlib
import json
import sys
from importlib import import_module
from pathlib import Path
from typing import Any

from detent.errors import DetentError
from detent.faces.child import FACES
from detent.faces.service import Desk


async def run(told: dict[str, Any]) -> None:
    """Serve until told to end, or until the axis has gone."""
    channels = {motor: Path(channel) for motor, channel in told["channels"].items()}
    desk = Desk(channels, told["face"], told["commands"])
    try:
        serve = import_module(f"detent.faces.{FACES[told['face']].module}").serve
        places = await serve(desk, told["address"])
    except ImportError as error:
        return tell(
            error=f"{error.name} is not installed; install it with: pip install 'detent[{FACES[told['face']].extra}]'"
        )
    except OSError as error:
        return tell(error=f"{told['address'] or 'its place'}: {error.strerror or error}")
    except DetentError as error:
        return tell(error=str(error))
    tell(places=places)
    reader = asyncio.StreamReader()
    await asyncio.get_running_loop().connect_read_pipe(lambda: asyncio.StreamReaderProtocol(reader), sys.stdin)
    ends = [asyncio.ensure_future(reader.read()), asyncio.ensure_future(desk.ended())]
    await asyncio.wait(ends, return_when=asyncio.FIRST_COMPLETED)
    return None


def tell(**said: object) -> None:
    """Answer whoever started this."""
    sys.stdout.write(json.dumps(said) + "\n")
    sys.stdout.flush()


if __name__ == "__main__":
    with contextlib.suppress(KeyboardInterrupt):
        asyncio.run(run(json.loads(sys.stdin.readline())))
