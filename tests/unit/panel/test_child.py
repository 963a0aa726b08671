import socket
from pathlib import Path

import pytest

from detent.errors import AxisError
from detent.panel.child import Child, PanelPlace


def test_a_port_that_is_taken_is_told(tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(AxisError, match=rf"127\.0\.0\.1, port {port} .*in use.*--headless"):
            Child(tmp_path / "axis.sock", PanelPlace(port=port))
    assert list(tmp_path.iterdir()) == []


def test_a_certificate_that_is_none_is_told(tmp_path: Path) -> None:
    pem = tmp_path / "axis.pem"
    pem.write_text("no certificate", encoding="ascii")
    with pytest.raises(AxisError, match=r"did not start at .*certificate anew"):
        Child(tmp_path / "axis.sock", PanelPlace(certificate=str(pem), key_file=str(pem)))


def test_a_panel_that_cannot_start_again_is_told_once(tmp_path: Path) -> None:
    child = Child(tmp_path / "axis.sock", PanelPlace())  # there is no axis: it ends
    child._process.wait(20.0)
    assert child.mend().startswith("The panel had ended, and runs again: http://127.0.0.1:")
    child._process.wait(20.0)
    with socket.create_server(("127.0.0.1", child._port)):
        assert "--headless" in child.mend()
        assert child.mend() == ""
    child.close()
