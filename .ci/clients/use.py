"""What a user of the generated Python client writes, against a running server: python use.py URL."""

import sys

from palpate_api import Client
from palpate_api.api.exploration import add_visual_prior, propose_contacts, report_contact
from palpate_api.api.sessions import create_session
from palpate_api.models import (
    AddVisualPriorRequest,
    ContactResultNoContact,
    CreateSessionRequest,
    NoContact,
    ProposeContactsRequest,
    ReportContactRequest,
    Vector3,
    VisualPrior,
)

client = Client(sys.argv[1])
created = create_session.sync(client=client, body=CreateSessionRequest(session_id="generated"))
points = [[0.01 * (i % 5), 0.01 * (i // 5), 0.3 + 0.002 * (i % 3)] for i in range(25)]
prior = VisualPrior(points=points, viewpoint=Vector3(z=1.0))
add_visual_prior.sync("generated", client=client, body=AddVisualPriorRequest(prior=prior))
first = propose_contacts.sync("generated", client=client, body=ProposeContactsRequest(top_k=1)).candidates[0]
missed = NoContact(swept_from=first.probe_start, swept_to=first.probe_end)
result = ContactResultNoContact(no_contact=missed, candidate_id=first.candidate_id)
reply = report_contact.sync("generated", client=client, body=ReportContactRequest(result=result, propose=1))
assert reply.seq == 3 and reply.session.stats.no_contacts == 1 and len(reply.candidates) == 1, reply
print(f"{created.session_id}: revision {reply.session.revision}")
