"""Any request that a stranger may send to the panel."""

from http.client import HTTPConnection

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from detent.panel.app import RULES
from detent.panel.keys import ROLES
from tests.live_panel import PanelRig

TEXT = st.text(st.characters(min_codepoint=33, max_codepoint=126), max_size=30)


PATHS = st.one_of(
    st.sampled_from([path for path in RULES if path != "/ws"]),
    st.builds(lambda path, more: f"{path}/{more}", st.sampled_from(["/static", "/api", "/enter", ""]), TEXT),
)


QUERIES = st.one_of(
    st.just(""),
    TEXT.map(lambda text: f"?{text}"),
    st.builds(lambda c, f: f"?channels={c}&first={f}", TEXT, st.one_of(TEXT, st.integers().map(str))),
    TEXT.map(lambda text: f"?ticket={text}"),
)


HEADERS = st.dictionaries(
    st.sampled_from(["accept", "cookie", "origin", "range", "if-none-match", "if-modified-since", "x-csrf-token",
                     "content-type", "sec-fetch-site", "accept-encoding", "x-forwarded-for", "upgrade"]),
    TEXT, max_size=4,
)  # fmt: skip


METHODS = st.sampled_from(["GET", "POST", "HEAD", "PUT", "DELETE", "OPTIONS", "PATCH", "TRACE"])


def answer(rig: PanelRig, method: str, path: str, headers: dict[str, str], body: bytes) -> int:
    """Status of a request as it is, valid or not; 0 where the connection was closed on it."""
    asked = HTTPConnection("127.0.0.1", rig.port, timeout=10.0)
    try:
        asked.putrequest(method, path, skip_host=True, skip_accept_encoding=True)
        for name, value in headers.items():
            asked.putheader(name, value)
        asked.endheaders(body)
        return asked.getresponse().status
    except (OSError, ValueError):
        return 0
    finally:
        asked.close()


def anything(rig: PanelRig, examples: int) -> None:
    """Ask anything, as anybody."""
    found: dict[int, int] = {}

    @settings(max_examples=examples, deadline=None, suppress_health_check=list(HealthCheck), database=None)
    @given(METHODS, PATHS, QUERIES, HEADERS, st.sampled_from(["", *ROLES]), st.binary(max_size=200))
    def ask(method: str, path: str, query: str, headers: dict[str, str], role: str, body: bytes) -> None:
        known = {"host": f"127.0.0.1:{rig.port}", "content-length": str(len(body))}
        if role:
            name, value = next(iter(rig.cookie(role).items()))
            who = rig.panel.keys.read(value, "cookie")
            assert who is not None
            known |= {"cookie": f"{name}={value}", "origin": rig.base, "x-csrf-token": rig.panel.keys.form_mark(who)}
        status = answer(rig, method, path + query, known | headers, body)
        found[status] = found.get(status, 0) + 1
        assert status < 500

    ask()
    assert {200, 401, 403, 404, 405} <= set(found)
