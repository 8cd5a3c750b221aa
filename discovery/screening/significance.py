"""How much an effect that is not there would seem to explain: a parametric bootstrap over the whole catalogue.

Under the smaller model a recording is its prediction plus noise. The noise of the bootstrap has the spectrum of what
the larger model leaves: white where the instrument is all there is, slow where the model is not perfect. Before there
is a larger model, it is that of the smaller one made smooth, so that what is missing does not pass for noise. Each
replicate is offered to every shape of every candidate, with the fitted parameters re-adjusted, and the best one counts;
to first order in the noise that is a projection on the sensitivities of one batched simulation.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from scipy import fft
from scipy.ndimage import uniform_filter1d

from discovery.estimation.bench import Bench
from discovery.foundation.arrays import FloatArray
from discovery.screening.attribution import Candidate, White

REPLICATES = 200


def surrogates(
    residual: FloatArray, bench: Bench, rng: np.random.Generator, count: int = REPLICATES, *, smooth: bool = False
) -> FloatArray:
    """Return noise with the spectrum of a residual, channel by channel, and random phases.

    Parameters
    ----------
    residual : ndarray, shape (n,)
        Normalised residual of the bench's recordings, zero in gaps.
    bench : Bench
        The recordings.
    rng : Generator
        Source of the phases.
    count : int
        Number of replicates.
    smooth : bool
        With the spectrum made smooth, and random amplitudes (Daniell, Supplement to the Journal of the Royal
        Statistical Society 8 (1946) 88): a line in the residual is none in the noise.

    Returns
    -------
    ndarray, shape (n, count)
        Theiler et al., Physica D 58 (1992) 77: surrogates of a linear Gaussian process.
    """
    found = np.empty((residual.size, count))
    for rows, present in bench.blocks():
        n = len(present)
        length = fft.next_fast_len(n, real=True)
        part = residual[rows].reshape(present.shape)
        made = np.empty((*present.shape, count))
        for c, here in enumerate(present.T):
            # Gaps hold zeros; the power of the others stands for them.
            filled = fft.rfft(part[:, c], length)[:, None] * np.sqrt(length / max(1, int(here.sum())))
            phase = np.exp(2j * np.pi * rng.random((len(filled), count)))
            if smooth:
                power = uniform_filter1d(np.square(np.abs(filled)), 2 * math.isqrt(n) + 1, axis=0)
                filled = np.sqrt(power * rng.standard_exponential(phase.shape))
            made[:, c] = fft.irfft(filled * phase, length, axis=0)[:n] * here[:, None]
        found[rows] = made.reshape(-1, count)
    return found


def chance_gains(candidates: Sequence[Candidate], jacobian: FloatArray, noise: FloatArray, white: White) -> FloatArray:
    """Return the largest chi-square that any candidate would remove from each replicate of the noise, sorted.

    Parameters
    ----------
    candidates : sequence of Candidate
        From `discovery.screening.attribution.screen` around the smaller model.
    jacobian : ndarray, shape (n, p)
        Of the smaller model: what its fitted parameters absorb.
    noise : ndarray, shape (n, k)
        From `surrogates`.
    white : callable
        Makes columns (n, k) white under the model error: chi-square is that of generalised least squares.

    Returns
    -------
    ndarray, shape (k,)
        Smallest first. Bounds are not imposed, so an effect of one sign is judged strictly.
    """
    known, _ = np.linalg.qr(white(jacobian[: len(noise)]))
    noise = white(noise)
    left = (noise - known @ (known.T @ noise)).astype(np.float32)
    largest = np.zeros(noise.shape[1])
    for candidate in candidates:
        largest = np.maximum(largest, candidate.shapes.under(white, known).powers(left).max(axis=0))
    return np.sort(largest)
