"""The high-gain observer of an integrator chain by forward differences."""

from __future__ import annotations

from hgorun.observers.base import observer
from hgorun.observers.forward_differences import ForwardDifferences


@observer("hgo_fd")
class ForwardDifferenceObserver(ForwardDifferences):
    """High-gain observer of an integrator chain, discretised by forward differences.

    With q = D xhat, D = diag(1, eps, ..., eps^(n-1)), and one step a sample,

        q(k+1) = q(k) + (T/eps) (A_0 q(k) + H_0 y_k),    A_0 = A - H_0 C

    T is the time from sample k to sample k + 1. What uses y_k is the estimate of t_(k+1): it is taken on when
    sample k + 1 arrives. The observer has no copy of the plant: it differentiates the output of a chain
    x_i' = x_(i+1), x_n' = phi, whatever phi is, and its error is of the order of eps times phi.

    eps > 0, small: the error's eigenvalues are those of A_0, the poles, over eps. The difference equation is
    stable when the spectral radius of I + (T/eps) A_0 is less than 1, for H_0 = (2, 2) when T < eps; beyond
    that the estimate diverges. Noise reaches component i with eps^(1-i) sqrt(T/eps): take hgo_sa where it
    has to die out, shgo where phi is known or the samples are rare.

    (42) of the paper prints xhat_1 = q_2f; it is q_1f, as in (44).
    """

    reference = "Lee, Choi, Khalil 2016, (19)-(20), (42)"
