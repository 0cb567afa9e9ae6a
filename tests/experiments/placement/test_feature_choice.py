from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from experiments.interaction import registry
from experiments.interaction.features import InteractionFeatures
from experiments.interaction.geometric import geometric_features
from experiments.placement.errors import NoAdmissibleStart
from experiments.placement.features import alike_in_contact, choose_features
from experiments.placement.settings import PRESETS
from experiments.scene.scene import MPCAT40


def relabelled(features: InteractionFeatures, name: str) -> InteractionFeatures:
    """The seat of a map on another class."""
    seat = features.semantics.argmax(-1) == MPCAT40.index("chair")
    semantics = features.semantics.copy()
    semantics[seat] = 0.0
    semantics[seat, MPCAT40.index(name)] = 10.0
    return dataclasses.replace(features, semantics=semantics)


def without_seat(features: InteractionFeatures) -> InteractionFeatures:
    on_floor = features.semantics.argmax(-1) == MPCAT40.index("floor")
    return dataclasses.replace(features, contact=features.contact * on_floor)


@pytest.fixture
def offer(monkeypatch):
    """offer(maps): a model that answers with these maps; returns settings that name it."""

    def settings_for(*maps: InteractionFeatures):
        monkeypatch.setitem(registry.INTERACTIONS, "offered", lambda *_: maps)
        return dataclasses.replace(PRESETS["fast"], interaction="offered")

    return settings_for


@pytest.fixture
def seated(sit, slim):
    return geometric_features(sit(60), slim, ("floor", "chair"))[0]


def test_maps_with_the_same_contacts_are_rivals_and_others_are_not(seated) -> None:
    bed, cautious = relabelled(seated, "bed"), without_seat(seated)
    maps = [seated, cautious, bed, dataclasses.replace(cautious, model="again")]
    assert alike_in_contact(maps, 0.5) == [[0, 2], [1, 3]]


def test_a_cautious_map_is_no_match_for_one_that_touches_and_has_a_start(
    sit, slim, seat_room, seated, offer
) -> None:
    settings = offer(seated, without_seat(seated))
    chosen = choose_features(sit(60), seat_room, slim, settings)
    assert np.array_equal(chosen.contact, seated.contact)


def test_the_next_contacts_are_tried_where_the_first_have_no_start(
    sit, slim, seat_room, seated, offer
) -> None:
    cautious = without_seat(seated)
    settings = offer(relabelled(seated, "bed"), relabelled(seated, "sofa"), cautious)
    chosen = choose_features(sit(60), seat_room, slim, settings)
    assert np.array_equal(chosen.contact, cautious.contact)


def test_the_first_refusal_is_told_where_no_map_has_a_start(
    sit, slim, seat_room, seated, offer
) -> None:
    settings = offer(relabelled(seated, "bed"), relabelled(seated, "toilet"))
    with pytest.raises(NoAdmissibleStart, match="bed"):
        choose_features(sit(60), seat_room, slim, settings)


def test_an_answer_is_never_that_of_a_model_that_has_since_gone(
    sit, slim, seat_room, seated
) -> None:
    settings, motion = dataclasses.replace(PRESETS["fast"], interaction="offered"), sit(60)
    for number in range(8):  # each model's memory may be the place of the next
        mine = dataclasses.replace(seated, model=f"model {number}")
        with pytest.MonkeyPatch.context() as patch:
            patch.setitem(registry.INTERACTIONS, "offered", lambda *_, mine=mine: (mine,))
            assert choose_features(motion, seat_room, slim, settings).model == f"model {number}"
