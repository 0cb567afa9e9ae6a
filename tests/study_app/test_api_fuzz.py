"""Schemathesis throws generated bodies at the JSON calls: never a server fault, never a false store."""

from __future__ import annotations

import json
from typing import Any

import schemathesis
from hypothesis import HealthCheck, Phase, given, settings
from schemathesis import GenerationMode
from schemathesis.core import NotSet
from sqlalchemy import select

from study_app.models import Response
from study_app.trial_page import AnswerBody, EventsBody
from study_app.trials import TicketBody

QUICK = settings(
    max_examples=25,
    deadline=None,
    database=None,
    phases=[Phase.generate],
    suppress_health_check=list(HealthCheck),
)
REPLIES = {str(code): {"description": "documented"} for code in (200, 400, 404, 409, 413, 415, 429)}


def call(body: dict[str, Any]) -> dict[str, Any]:
    content = {"application/json": {"schema": body}}
    return {"post": {"requestBody": {"required": True, "content": content}, "responses": REPLIES}}


def schema_of(paths: dict[str, type]) -> dict[str, Any]:
    """An OpenAPI description made from the same models that the app validates by."""
    components: dict[str, Any] = {}
    described = {}
    for path, model in paths.items():
        body = model.model_json_schema(ref_template="#/components/schemas/{model}")
        components |= body.pop("$defs", {})
        described[path] = call(body)
    return {
        "openapi": "3.0.3",
        "info": {"title": "trial page", "version": "1"},
        "paths": described,
        "components": {"schemas": components},
    }


def test_generated_bodies_meet_documented_answers_only(site: Any) -> None:
    visitor = site.visitor()
    base = visitor.go_to_trial().main["data-answer-url"].removesuffix("answer")
    paths = {
        f"{base}answer": AnswerBody,
        f"{base}events": EventsBody,
        f"{base}none/answer": AnswerBody,
        "/api/simulation": TicketBody,
    }
    schema = schemathesis.openapi.from_dict(schema_of(paths))
    seen: set[int] = set()
    for result in schema.get_all_operations():
        seen |= fuzz(result.ok(), visitor)
    assert seen <= {200, 400, 404} and {200, 400} <= seen
    with site.database.read() as session:
        assert len(session.scalars(select(Response)).all()) <= 1


def raw(body: Any) -> bytes:
    if isinstance(body, NotSet):
        return b""
    return body if isinstance(body, bytes) else json.dumps(body).encode()


def fuzz(operation: Any, visitor: Any) -> set[int]:
    """Valid and broken bodies for one call; collects the status codes."""
    codes: set[int] = set()

    def send(case: Any) -> None:
        body = raw(case.body)
        headers = {"X-CSRFToken": visitor.page.csrf}
        reply = visitor.client.post(operation.path, data=body, headers=headers)
        assert reply.is_json and "Traceback" not in reply.text
        codes.add(reply.status_code)

    for mode in (GenerationMode.POSITIVE, GenerationMode.NEGATIVE):
        QUICK(given(operation.as_strategy(generation_mode=mode))(send))()
    return codes
