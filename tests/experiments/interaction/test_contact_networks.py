from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from torch.nn import functional

from experiments.body.embedded import BODY_FILE, BODY_NAMES, read_body
from experiments.body.surface import euler_characteristic, is_closed
from experiments.interaction.contact_loss import (
    class_loss,
    class_loss_posa,
    contact_loss,
    kl_divergence,
)
from experiments.interaction.contact_network import build_network
from experiments.interaction.feature_mesh import PART_NAMES, feature_faces, vertex_parts
from experiments.interaction.mesh import feature_vertices
from experiments.interaction.network import NetworkShape, part_members, sample_posterior
from experiments.interaction.spiral import spiral_tables, spirals_of

POINT = NetworkShape("point", (0, 2, 3, 10), 703, latent=4, width=16)
SPIRAL = NetworkShape("spiral", (0, 2, 3, 10), 703, latent=8, width=8)
TETRAHEDRON = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]])


@pytest.fixture(scope="module")
def reference():
    return read_body(BODY_FILE, "male_slim")


def bodies(count: int, seed: int = 0):
    rng = np.random.default_rng(seed)
    vertices = torch.as_tensor(rng.normal(0, 0.4, (count, 703, 3)), dtype=torch.float32)
    height = vertices[..., 2] - vertices[..., 2].amin(1, keepdim=True)
    label = torch.as_tensor(rng.integers(0, 4, (count, 703)))
    return vertices, height, (label > 0).float(), label


@pytest.mark.parametrize("shape", [POINT, SPIRAL], ids=["point", "spiral"])
def test_a_network_says_contact_and_classes_of_every_vertex(shape: NetworkShape) -> None:
    network = build_network(shape, seed=3)
    vertices, height, contact, label = bodies(2)
    mean, log_var = network.encode(vertices, height, contact, label)
    logit, classes = network.decode(vertices, height, mean)
    assert mean.shape == log_var.shape == (2, shape.latent)
    assert logit.shape == (2, 703) and classes.shape == (2, 703, 4)
    assert log_var.min() >= -8 and log_var.max() <= 4


@pytest.mark.parametrize("shape", [POINT, SPIRAL], ids=["point", "spiral"])
def test_bodies_of_one_batch_do_not_influence_each_other(shape: NetworkShape) -> None:
    network = build_network(shape, seed=3).eval()
    vertices, height, contact, label = bodies(3)
    z = torch.randn((3, shape.latent), generator=torch.Generator().manual_seed(1))
    together = network.decode(vertices, height, z)[1]
    alone = network.decode(vertices[1:2], height[1:2], z[1:2])[1]
    assert torch.allclose(together[1:2], alone, atol=1e-5)
    seen = network.encode(vertices, height, contact, label)[0]
    seen_alone = network.encode(vertices[1:2], height[1:2], contact[1:2], label[1:2])[0]
    assert torch.allclose(seen[1:2], seen_alone, atol=1e-5)


@pytest.mark.parametrize("edge_m", [0.02, 0.05])
def test_before_training_the_network_of_ours_is_the_height_rule(edge_m: float) -> None:
    network = build_network(replace(POINT, edge_m=edge_m), seed=3)
    vertices, height, _, _ = bodies(4)
    height = height.clamp(max=edge_m + 0.02)
    clear = (height - edge_m).abs() > 0.008  # beyond the soft step
    logit = network.decode(vertices, height, torch.zeros(4, POINT.latent))[0]
    assert torch.equal((logit > 0)[clear], (height < edge_m)[clear])


def test_first_weights_are_those_of_the_seed_and_leave_torch_generator_alone() -> None:
    before = torch.random.get_rng_state()
    one, again, other = (build_network(POINT, seed).state_dict() for seed in (5, 5, 6))
    assert torch.equal(torch.random.get_rng_state(), before)
    assert all(torch.equal(one[name], again[name]) for name in one)
    assert not torch.equal(one["embedding"], other["embedding"])


def test_an_unknown_architecture_is_refused() -> None:
    with pytest.raises(ValueError, match="one of point, spiral"):
        build_network(NetworkShape("cube", (0, 2), 703), seed=0)


def test_every_layer_of_both_networks_learns() -> None:
    for shape in (POINT, SPIRAL):
        network = build_network(shape, seed=0)
        vertices, height, contact, label = bodies(2)
        mean, log_var = network.encode(vertices, height, contact, label)
        logit, classes = network.decode(vertices, height, mean + 0.1)
        loss = contact_loss(logit, contact) + class_loss(classes, label, contact)
        (loss + kl_divergence(mean, log_var)).backward()
        idle = [name for name, value in network.named_parameters() if not value.grad.any()]
        assert idle == []


def test_the_contact_loss_of_an_undecided_network_is_log_two_everywhere() -> None:
    contact = torch.tensor([[1.0, 0.0, 0.0]], dtype=torch.float64)
    loss = contact_loss(torch.zeros((1, 3), dtype=torch.float64), contact)
    assert float(loss) == pytest.approx(np.log(2))


def test_the_class_loss_counts_vertices_in_contact_and_never_considers_void() -> None:
    logits = torch.zeros((1, 4, 4), dtype=torch.float64)
    logits[..., 0] = 50.0
    label = torch.tensor([[0, 2, 3, 0]])
    loss = class_loss(logits, label, (label > 0).double())
    # Two of four vertices touch, three classes beside void are equally likely.
    assert float(loss) == pytest.approx(2 / 4 * np.log(3))
    assert float(class_loss(logits, 0 * label, torch.zeros((1, 4)))) == 0.0


def test_posa_class_loss_is_the_mean_cross_entropy_with_void() -> None:
    logits = torch.randn((2, 5, 4), generator=torch.Generator().manual_seed(0))
    label = torch.randint(0, 4, (2, 5), generator=torch.Generator().manual_seed(1))
    by_hand = -functional.log_softmax(logits, -1).gather(-1, label[..., None]).mean()
    assert torch.allclose(class_loss_posa(logits, label), by_hand)


@settings(max_examples=25, deadline=None)
@given(st.floats(-3, 3), st.floats(-4, 3))
def test_the_kl_term_equals_that_of_two_gaussians(mean: float, log_var: float) -> None:
    found = kl_divergence(*(torch.full((1, 2), x, dtype=torch.float64) for x in (mean, log_var)))
    posterior = torch.distributions.Normal(
        torch.tensor(mean, dtype=torch.float64), float(np.exp(log_var / 2))
    )
    standard = torch.distributions.Normal(torch.tensor(0.0, dtype=torch.float64), 1.0)
    expected = 2 * torch.distributions.kl_divergence(posterior, standard)
    assert torch.allclose(found, expected, rtol=1e-6, atol=1e-9)


def test_every_loss_passes_gradcheck_in_double_precision() -> None:
    draw = torch.Generator().manual_seed(0)
    logit = torch.randn((2, 5), dtype=torch.float64, generator=draw, requires_grad=True)
    classes = torch.randn((2, 5, 4), dtype=torch.float64, generator=draw, requires_grad=True)
    mean = torch.randn((2, 3), dtype=torch.float64, generator=draw, requires_grad=True)
    label = torch.tensor([[0, 1, 2, 3, 0], [3, 3, 0, 1, 2]])
    contact = (label > 0).double()
    assert torch.autograd.gradcheck(lambda x: contact_loss(x, contact), (logit,))
    assert torch.autograd.gradcheck(lambda x: class_loss(x, label, contact), (classes,))
    assert torch.autograd.gradcheck(lambda x: class_loss_posa(x, label), (classes,))
    assert torch.autograd.gradcheck(lambda x: kl_divergence(x, 0.3 * x), (mean,))
    noise = torch.randn((2, 3), dtype=torch.float64, generator=draw)
    assert torch.autograd.gradcheck(lambda x: sample_posterior(x, 0.3 * x, noise), (mean,))


def test_the_feature_mesh_is_a_closed_sphere_over_all_feature_vertices(reference) -> None:
    faces = feature_faces(reference)
    assert is_closed(faces)
    assert euler_characteristic(faces) == 2
    assert np.array_equal(np.unique(faces), np.arange(len(feature_vertices(reference))))


def test_body_parts_are_the_same_for_all_embedded_bodies_and_none_is_empty(reference) -> None:
    parts = vertex_parts(reference)
    for name in BODY_NAMES:
        assert np.array_equal(vertex_parts(read_body(BODY_FILE, name)), parts)
    assert np.bincount(parts, minlength=len(PART_NAMES)).min() >= 15
    ids = feature_vertices(reference)
    sole = np.isin(ids, reference.regions["left_sole"])
    assert set(parts[sole]) == {PART_NAMES.index("left_foot")}


def test_members_of_a_part_are_its_vertices_and_repeats_of_the_first() -> None:
    members = part_members(torch.tensor([0, 1, 0, 1, 0]))
    assert members.tolist() == [[0, 2, 4], [1, 3, 1]]


def test_spirals_of_a_tetrahedron_start_at_the_lowest_neighbour_and_fill_up() -> None:
    assert spirals_of(TETRAHEDRON, 4, length=6).tolist() == [
        [0, 1, 2, 3, 0, 0],
        [1, 0, 3, 2, 1, 1],
        [2, 0, 1, 3, 2, 2],
        [3, 0, 2, 1, 3, 3],
    ]


def test_spirals_walk_the_first_ring_then_the_second(reference) -> None:
    faces = feature_faces(reference)
    spirals = spirals_of(faces, 703).numpy()
    neighbours = [set(faces[(faces == v).any(1)].ravel().tolist()) - {v} for v in range(703)]
    for vertex in (0, 11, 300, 702):
        spiral, ring = spirals[vertex], neighbours[vertex]
        assert spiral[0] == vertex and spiral[1] == min(ring)
        first = spiral[1 : 1 + min(len(ring), 8)].tolist()
        assert set(first) <= ring and len(set(first)) == len(first)
        # One walks around the vertex: each neighbour touches the one before.
        assert all(b in neighbours[a] for a, b in itertools.pairwise(first))
        second = set(spiral[1 + len(ring) :].tolist())
        assert second <= set().union(*(neighbours[near] for near in ring)) - ring - {vertex}


def test_the_coarser_meshes_of_the_spiral_network_are_subsets_of_the_finer(reference) -> None:
    points = reference.rest_vertices[feature_vertices(reference)]
    tables = spiral_tables(points, feature_faces(reference))
    sizes = [len(spiral) for spiral in tables.spirals]
    assert sizes == [703, len(tables.kept[0]), len(tables.kept[1])]
    assert 170 <= sizes[1] <= 180 and 40 <= sizes[2] <= 48
    for spiral in tables.spirals:
        assert int(spiral.max()) == len(spiral) - 1 and bool((spiral >= 0).all())
