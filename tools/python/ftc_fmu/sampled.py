"""A co-simulation FMU seen as a sampled system: linearised by small moves of its inputs."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ftc_fmu.errors import DesignFileError

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

# Relative size of a move of an input. What the FMU's integrator leaves out counts the less the larger
# it is; what is not linear grows with its fourth power, because moves of two sizes are combined.
MOVE = 1e-2
# Largest difference, relative to the moves, that two runs at rest may show.
AT_REST = 1e-3
# Directions of the state that moves excite less than this share of the strongest are not seen.
LEAST_EXCITATION = 1e-7


class SampledModel:
    """Runs a fresh instance again for each move: what FMUs without saved states can do, too."""

    def __init__(
        self,
        fresh: Callable[[], Any],
        names: tuple[Sequence[str], Sequence[str], Sequence[str]],
        sizes: np.ndarray,
        sample_time: float,
        settle: float,
    ) -> None:
        """Keeps how to make an instance, the names of inputs, outputs and states, and the inputs' sizes."""
        self._fresh = fresh
        self._inputs, self._outputs, self._states = names
        self._sample_time = sample_time
        self._settle = round(settle / sample_time)
        self._sizes = sizes

    def _run(self, moves: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """States and outputs (samples + 1 each) under moves of the inputs (samples x m)."""
        model = self._fresh()
        try:
            given = model.references(self._inputs)
            read = model.references([*self._states, *self._outputs])
            rest = model.get(given)
            seen = []
            for tick in range(self._settle + len(moves) + 1):
                at = tick - self._settle
                if at >= 0:
                    seen.append(model.get(read))
                if at == len(moves):
                    break
                model.set(given, rest + (moves[at] if at >= 0 else 0.0))
                model.fmu.doStep(
                    currentCommunicationPoint=tick * self._sample_time, communicationStepSize=self._sample_time
                )
        finally:
            model.free()
        table = np.array(seen)
        n = len(self._states)
        self._rest = rest
        return table[:, :n], table[:, n:]

    def _response(self, column: int, samples: int, size: float) -> tuple[np.ndarray, np.ndarray]:
        """States and outputs per unit of a pulse on one input, by central differences."""
        moves = np.zeros((samples, len(self._inputs)))
        moves[0, column] = size
        above, below = self._run(moves), self._run(-moves)
        dX, dY = ((high - low) / (2.0 * size) for high, low in zip(above, below, strict=True))
        return dX, dY

    def linearise(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, tuple]:
        """Returns A, B, C, D and the point (x, u, y).

        Raises:
            DesignFileError: The FMU is not at rest, or the moves do not reach every state.
        """
        n, m, p = len(self._states), len(self._inputs), len(self._outputs)
        samples = 2 * n + 2
        X, Y = self._run(np.zeros((samples, m)))
        sizes = np.maximum(np.abs(self._rest), self._sizes) * MOVE
        now, moved, following, read = [], [], [], []
        for column in range(m):
            whole, half = (self._response(column, samples, share * sizes[column]) for share in (1.0, 0.5))
            dX, dY = ((4.0 * fine - coarse) / 3.0 for fine, coarse in zip(half, whole, strict=True))
            impulse = np.zeros((samples, m))
            impulse[0, column] = 1.0
            now.append(dX[:-1])
            moved.append(impulse)
            following.append(dX[1:])
            read.append(dY[1:])
        drift = np.abs(X - X[0]).max(axis=0)
        effect = np.abs(np.vstack(following)).max(axis=0) * sizes.max()
        if (drift > AT_REST * effect + 1e-12 * np.abs(X[0])).any():
            state = self._states[int(np.argmax(drift - AT_REST * effect))]
            raise DesignFileError(
                f"the FMU is not at rest at its operating point ({state} moves): give its inputs and states there, "
                "or seconds to settle=",
                "operating_points",
            )
        return *self._fit(np.vstack(now), np.vstack(moved), np.vstack(following), np.vstack(read), (n, m, p)), (
            X[0],
            self._rest,
            Y[0],
        )

    def _fit(
        self,
        now: np.ndarray,
        moved: np.ndarray,
        following: np.ndarray,
        read: np.ndarray,
        sizes: tuple[int, int, int],
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        n, _, _ = sizes
        scale = np.abs(following).max(axis=0)
        scale[scale == 0.0] = 1.0
        excited = np.linalg.svd(now / scale, compute_uv=False)
        if len(excited) < n or excited[-1] <= LEAST_EXCITATION * excited[0]:
            raise DesignFileError(
                "the inputs do not move every state, or two of states= say the same: name more inputs "
                "(disturbance_inputs=), or fewer states",
                "states",
            )
        both = np.hstack([now / scale, moved])
        AB = np.linalg.lstsq(both, following / scale, rcond=None)[0].T
        A, B = AB[:, :n] * scale[:, None] / scale, AB[:, n:] * scale[:, None]
        # Outputs read at the end of a step: what the step's own input still shows there is a
        # direct feed-through.
        CD = np.linalg.lstsq(np.hstack([following / scale, moved]), read, rcond=None)[0].T
        C, D = CD[:, :n] / scale, CD[:, n:]
        D[np.abs(D) <= 1e-7 * np.abs(read).max()] = 0.0
        return A, B, C, D
