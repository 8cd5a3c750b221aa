"""Moves, proposals and growth of ensembles on densities whose moments are known, and diagnostics that see failure."""

from __future__ import annotations

import emcee
import numpy as np
import pytest
from arviz_stats.base import array_stats
from scipy import stats

from discovery.estimation.proposal import Proposal
from discovery.posterior import ensembles
from discovery.posterior.checkpoint import restore, save
from discovery.posterior.diagnostics import Convergence, convergence, tail_effective
from discovery.posterior.moves import IndependenceMove

MOVES = {
    "independence": lambda: IndependenceMove(Proposal.standard(3)),
    "differential_evolution": emcee.moves.DEMove,
    "jump": lambda: emcee.moves.DEMove(gamma0=1.0),
    "stretch": emcee.moves.StretchMove,
}


def sampled(log_density, dimension, seed, walkers=64, steps=448):
    """Draws after burn-in of four ensembles, shape (ensembles, steps, walkers, d), and their diagnostics."""
    seeds = np.random.SeedSequence(seed).spawn(4)
    group = ensembles.start_ensembles(log_density, dimension, walkers=walkers, seeds=seeds)
    assert list(ensembles.grow(group, steps))[-1] == steps
    burn_in = max(steps // 4, *(e.adapted for e in group))
    draws = np.stack([e.chain[burn_in:] for e in group])
    return draws, convergence(draws)


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=pytest.mark.slow) if n in ("independence", "jump") else n for n in MOVES]
)
def test_each_move_alone_leaves_a_gaussian_as_it_is(name):
    """Its variance must stay, to the scatter between independent ensembles."""
    scale = np.array([1.0, 0.3, 2.0])
    correlated = np.linalg.cholesky([[1.0, 0.5, 0.0], [0.5, 1.0, -0.3], [0.0, -0.3, 1.0]]) * scale[:, None]
    inverse = np.linalg.inv(correlated)
    found = []
    for seed in range(8):
        sampler = emcee.EnsembleSampler(
            128, 3, lambda x: -0.5 * ((x @ inverse.T) ** 2).sum(axis=1), moves=MOVES[name](), vectorize=True
        )
        start = np.random.default_rng(seed).standard_normal((128, 3)) @ correlated.T
        sampler.run_mcmc(emcee.State(start, random_state=np.random.RandomState(seed).get_state()), 500)
        found.append(((sampler.get_chain(discard=100, flat=True) @ inverse.T) ** 2).mean())
    error = np.std(found, ddof=1) / np.sqrt(len(found))
    assert error < 0.01
    assert abs(np.mean(found) - 1) < 4.5 * error


@pytest.mark.slow
@pytest.mark.parametrize(
    ("dimension", "sd", "seed"),
    [(2, 1.0, 1), (2, 1.0, 2), (3, 0.7, 3), (4, 1.0, 4)],
)
def test_two_peaks_have_their_weights(dimension, sd, seed):
    """Eight standard deviations apart, and the ensembles start around the larger one."""
    weight, away = 0.3, np.zeros(dimension)
    away[0], away[-1] = 6.4, 4.8

    def log_density(z):
        near = np.log(1 - weight) - 0.5 * (z**2).sum(axis=1)
        far = np.log(weight) - 0.5 * (((z - away) / sd) ** 2).sum(axis=1) - dimension * np.log(sd)
        return np.logaddexp(near, far)

    draws, found = sampled(log_density, dimension, seed)
    far = draws @ away > 0.5 * away @ away
    (effective,) = convergence(far[..., None].astype(float)).ess
    assert effective > 1000
    assert far.mean() == pytest.approx(weight, abs=4 * np.sqrt(weight * (1 - weight) / effective))
    assert draws[far].mean(axis=0) == pytest.approx(away, abs=0.1)
    assert draws[far].std(axis=0) == pytest.approx(sd, rel=0.1)
    assert found.r_hat.max() < 1.01


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_banana_has_its_marginals(seed):
    """x is normal, and y given x is normal around b x^2."""
    a, b = 1.5, 0.5

    def log_density(z):
        return -0.5 * ((z[:, 0] / a) ** 2 + (z[:, 1] - b * (z[:, 0] ** 2 - a**2)) ** 2)

    draws, found = sampled(log_density, 2, seed, walkers=128)
    assert found.r_hat.max() < 1.01
    x = draws[..., 0] / a
    rest = draws[..., 1] - b * a**2 * (x**2 - 1)
    for quantity, mean, sd in ((x, 0.0, 1.0), (x**2, 1.0, np.sqrt(2)), (rest, 0.0, 1.0), (rest**2, 1.0, np.sqrt(2))):
        (effective,) = convergence(quantity[..., None]).ess
        assert effective > 500
        assert quantity.mean() == pytest.approx(mean, abs=4.5 * sd / np.sqrt(effective))


def gamma_and_normal(z):
    """A product of a Gamma and a shifted, correlated Gaussian, which the proposal only roughly resembles."""
    inside = z[:, 0] > 0
    x = np.where(inside, z[:, 0], 1.0)
    return np.where(inside, np.log(x) - 2 * x - 0.5 * ((z[:, 1] - z[:, 0]) / 0.3) ** 2, -np.inf)


def group_of_four():
    seeds = np.random.SeedSequence(3).spawn(4)
    return ensembles.start_ensembles(gamma_and_normal, 2, walkers=32, seeds=seeds)


@pytest.mark.parametrize(
    ("ess", "tau", "r_hat", "longer"),
    [(500, 10, 1.0, 8), (500, 400, 1.0, 20), (8000, 10, 1.05, 5), (8000, 10, 1.005, 1), (500, np.nan, 1.0, np.inf)],
)
def test_the_slowest_rule_says_how_much_longer_a_run_is(ess: float, tau: float, r_hat: float, longer: float) -> None:
    found = Convergence(*(np.array([[easy, it]]) for easy, it in ((1.0, r_hat), (1.0, tau), (9e3, ess))), 1000)
    assert found.times_longer(4000, 1.01) == pytest.approx(longer)
    assert found.meets(4000, 1.01) == (longer == 1)


def test_moves_sample_a_density_unlike_their_proposal():
    group = group_of_four()
    assert list(ensembles.grow(group, 900))[-1] == 900
    assert any(e.adapted for e in group)
    draws = np.stack([e.chain[320:] for e in group])
    found = convergence(draws)
    assert found.meets(1000, 1.01)
    thin = int(2 * found.tau.max() + 1)
    points = draws[:, ::thin].reshape(-1, 2)
    assert stats.kstest(points[:, 0], stats.gamma(2, scale=0.5).cdf).pvalue > 1e-4
    assert stats.kstest((points[:, 1] - points[:, 0]) / 0.3, "norm").pvalue > 1e-4


@pytest.mark.slow
def test_pieces_of_blocks_are_the_same_chain(tmp_path, monkeypatch):
    """Chains are kept every few seconds: nothing depends on where, and a run goes on from within a block."""
    whole, pieces, resumed = group_of_four(), group_of_four(), group_of_four()
    stops = list(ensembles.grow(whole, 500))
    monkeypatch.setattr(ensembles, "_KEPT_AFTER", 1e-9)
    kept = []

    def keep():
        kept.append(len(pieces[0].chain))
        if kept[-1] == 171:
            raise KeyboardInterrupt
        save(tmp_path / "chain.h5", pieces, "run")

    with pytest.raises(KeyboardInterrupt):
        list(ensembles.grow(pieces, 500, keep))
    assert kept[-2:] == [170, 171]
    assert restore(tmp_path / "chain.h5", resumed, "run") is not None
    assert list(ensembles.grow(resumed, 500)) == [stop for stop in stops if stop > 170]
    for one, other in zip(whole, resumed, strict=True):
        assert np.array_equal(one.chain, other.chain)
        assert np.array_equal(one.log_prob, other.log_prob)


def test_adapted_ensembles_continue_from_a_checkpoint(tmp_path):
    whole, first, second = group_of_four(), group_of_four(), group_of_four()
    list(ensembles.grow(whole, 340))
    list(ensembles.grow(first, 240))
    save(tmp_path / "chain.h5", first, "run")
    assert restore(tmp_path / "chain.h5", second, "run") is not None
    list(ensembles.grow(second, 340))
    assert any(e.adapted for e in second)
    for a, b in zip(whole, second, strict=True):
        assert np.array_equal(a.chain, b.chain)
        assert np.array_equal(a.log_prob, b.log_prob)
        assert a.adapted == b.adapted
    assert restore(tmp_path / "none.h5", second, "run") is None


def test_convergence_sees_ensembles_that_disagree_and_coupled_walkers():
    rng = np.random.default_rng(2)
    draws = rng.standard_normal((4, 200, 16, 3))
    draws[3, ..., 1] += 0.6
    draws[..., 2] = 0.6 * draws[..., 2] + 0.8 * rng.standard_normal((4, 200, 1))
    found = convergence(draws)
    assert found.r_hat[0] < 1.01 < found.r_hat[1]
    # Independent draws count in full; walkers that share 64 % of their variance count as little more than one.
    assert found.ess[0] == pytest.approx(4 * 200 * 16, rel=0.25)
    assert found.ess[2] == pytest.approx(4 * 200 / 0.66, rel=0.25)
    assert not found.meets(10, 1.01)


def test_effective_samples_agree_with_arviz():
    """On chains of known autocorrelation, with every walker as one of arviz's chains."""
    rng = np.random.default_rng(4)
    rho = np.array([0.0, 0.4, 0.8])
    draws = rng.standard_normal((4, 300, 32, 3))
    for k in range(1, 300):
        draws[:, k] = rho * draws[:, k - 1] + np.sqrt(1 - rho**2) * draws[:, k]
    found = convergence(draws)
    tau = (1 + rho) / (1 - rho)
    assert found.tau == pytest.approx(tau, rel=0.3)
    assert found.ess == pytest.approx(4 * 300 * 32 / tau, rel=0.3)
    chains = np.moveaxis(draws, -1, 0).swapaxes(2, 3).reshape(3, 128, 300)
    bulk = np.asarray(array_stats.ess(chains, chain_axis=1, draw_axis=2, method="bulk"))
    tail = np.asarray(array_stats.ess(chains, chain_axis=1, draw_axis=2, method="tail", prob=(0.05, 0.95)))
    assert found.ess == pytest.approx(bulk, rel=0.3)
    assert tail_effective(draws) == pytest.approx(tail, rel=0.3)


def test_convergence_sees_walkers_that_never_leave():
    """Each ensemble has its walkers on two peaks in the same parts, and none changes sides."""
    draws = np.random.default_rng(6).standard_normal((4, 100, 32, 1))
    draws[:, :, ::2] += 8
    found = convergence(draws)
    assert found.r_hat[0] < 1.01
    assert not found.meets(10, 1.01)


def test_ill_suited_proposal_is_replaced_and_a_good_one_kept():
    round_density, shifted = (lambda z: -0.5 * (z**2).sum(axis=1)), (lambda z: -0.5 * ((z - 2) ** 2 / 0.1).sum(axis=1))
    for log_density, replaced in ((round_density, False), (shifted, True)):
        seeds = np.random.SeedSequence(3).spawn(4)
        group = ensembles.start_ensembles(log_density, 2, walkers=32, seeds=seeds)
        list(ensembles.grow(group, 200))
        assert all(e.informed for e in group)
        centres = np.array([e.independence.proposal.centre for e in group])
        assert np.abs(centres - 2 * replaced).max() < 0.2
        accepted = [e.moves["independence"].accepted / e.moves["independence"].proposed for e in group]
        assert min(accepted) > 0.75
