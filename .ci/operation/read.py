"""Reads metrics with Prometheus's own parser, and compares them with what was sent and with what is documented."""

import argparse
import math
import re
from pathlib import Path

from prometheus_client.parser import text_string_to_metric_families

arguments = argparse.ArgumentParser()
arguments.add_argument("metrics", type=Path)
arguments.add_argument("--contacts", type=int, required=True)
arguments.add_argument("--sessions", type=int, required=True)
arguments.add_argument("--documented", type=Path, required=True)
given = arguments.parse_args()

families = {family.name: family for family in text_string_to_metric_families(given.metrics.read_text())}


def total(sample: str, **labels: str) -> float:
    """The sum of all samples of this name with these labels."""
    samples = [s for family in families.values() for s in family.samples if s.name == sample]
    assert samples, f"no {sample}"
    return sum(s.value for s in samples if labels.items() <= s.labels.items())


assert all(family.documentation for family in families.values()), "a series without a help text"
for family in families.values():
    assert family.name.startswith("palpate_"), family.name
    assert all(math.isfinite(sample.value) for sample in family.samples), family.name

assert total("palpate_contacts_total") == given.contacts
assert total("palpate_views_total") == given.sessions
assert total("palpate_calls_total", method="ReportContact", outcome="OK") == given.contacts
assert total("palpate_calls_total", method="CreateSession", outcome="OK") == given.sessions
assert total("palpate_call_seconds_count", method="ReportContact") == total("palpate_calls_total", method="ReportContact")
assert total("palpate_call_seconds_bucket", method="ReportContact", le="+Inf") == given.contacts
assert total("palpate_compute_seconds_count", work="contact") == given.contacts
assert total("palpate_queue_wait_seconds_count", work="contact") == given.contacts
assert total("palpate_committed_changes_total") >= given.contacts + 2 * given.sessions
assert total("palpate_sessions") == given.sessions
assert total("palpate_ready") == 1

described = set(re.findall(r"^\| `(palpate_\w+)`", given.documented.read_text(), re.MULTILINE))
served = {family.name + ("_total" if family.type == "counter" else "") for family in families.values()}
assert served == described, f"only served: {served - described}, only documented: {described - served}"
print(f"{len(served)} series, as documented; {given.contacts} contacts of {given.sessions} sessions, counted once each")
