"""Sends the examples of a server's OpenAPI document in their order: `python begin.py URL`."""

import sys

import requests

url = sys.argv[1]
paths = requests.get(f"{url}/openapi.json", timeout=60).json()["paths"]
for path in ["", "/{session_id}/priors", "/{session_id}/contacts"]:
    operation = paths[f"/v1/sessions{path}"]["post"]
    session_ids = [p["example"] for p in operation["parameters"] if p["name"] == "session_id"]
    target = f"{url}/v1/sessions{path}".replace("{session_id}", "".join(session_ids))
    body = operation["requestBody"]["content"]["application/json"]["example"]
    requests.post(target, json=body, timeout=60).raise_for_status()
