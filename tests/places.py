"""Where the project stands, and the recordings of real machines beside it, which a checkout may lack."""

from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
DATA = ROOT.parent / "shared" / "data"
