"""Two-level p-multigrid: displacements are smoothed, and the first-order ones among them solved on the cell corners.

The coarse space is an eighth of the size, so it can be factorised where the second-order problem of the same mesh
is far too large for that, and is set up in a fraction of the time of an algebraic hierarchy on the fine level.

The fine level works in single precision, on padded values, see `matrix_free.TangentOperator`.
"""

from __future__ import annotations

from math import log10
from typing import Any

import numpy as np

from asperity.arrays import Singles
from asperity.linear.coarse import make_coarse
from asperity.linear.matrix_free import TangentOperator
from asperity.linear.petsc import set_defaults
from asperity.mesh.element import node_ends
from asperity.runtime.compiled import solver as _solver
from asperity.runtime.parallel import summed

ITERATIONS = 1000  # of a Krylov method with it, at most
SWEEPS = 3  # of the smoother, before and after the coarse correction
LANCZOS, UPDATE = 20, 4  # steps of an estimate of the greatest eigenvalue: from the start, and for the next matrix
RENEWAL = 1.5  # increase of the iterations at which the coarse matrix is renewed
LAG, LAG_SHARE = 16, 1e-3  # dofs held or released since the coarse matrix was made, up to which it is kept; of all dofs
NOISE = 0.1  # in the start vector of an update, relative to the result of the one before
SMOOTHED = (0.1, 1.1)  # part of the spectrum that is damped, in units of the estimate


class PMultigrid:
    """Preconditioner for the tangent of a solid on its free dofs, as a python context of PETSc; collective.

    A V-cycle with Chebyshev's iteration on the Jacobi-scaled matrix as smoother (Adams et al., J. Comput. Phys. 188
    (2003) 593). The other dofs are masked, on the fine level and in the interpolation, so that the cycle never moves
    them; corners that are not free get a unit row in the coarse matrix.

    Args:
        symmetric: whether it is symmetric; the smoother treats any operator as if it were

    Attributes:
        ready: whether the last update succeeded
        measures: whether `energy` is computed after each V-cycle
    """

    def __init__(self, tangent: TangentOperator, symmetric: bool = True) -> None:
        from dolfinx import fem
        from scipy import sparse

        self._tangent, self._solid, self._symmetric = tangent, tangent.solid, symmetric
        solid = self._solid
        coarse = fem.functionspace(solid.mesh, ("Lagrange", 1, (3,))).dofmap
        index_map = coarse.index_map
        corners = index_map.size_local + index_map.num_ghosts
        self._corners = np.empty(corners, dtype=np.int32)  # node at each corner, ghosts included
        self._corners[coarse.list] = solid.V.dofmap.list[:, :4]
        self._owned_corners = index_map.size_local
        # of each node: the corner it is, twice, or the ends of its edge
        self._parents = np.empty((solid.nodes, 2), dtype=np.int32)
        for k, ends in enumerate(node_ends()):
            self._parents[solid.V.dofmap.list[:, k]] = coarse.list[:, ends]
        # from corner dofs to padded ones: a corner keeps its value, an edge takes the mean of its ends
        half = np.full(2 * solid.nodes, 0.5, dtype=np.float32)
        at = np.repeat(np.arange(solid.nodes), 2), self._parents.ravel()
        local = sparse.coo_array((half, at), (solid.nodes, corners)).tocsr()
        self._prolongation = sparse.kron(local, sparse.eye_array(4, 3, dtype=np.float32), format="csr")
        self._restriction = self._prolongation[: 4 * solid.owned].T.tocsr()
        self._coarse = make_coarse(coarse, solid.points[self._corners], solid.comm, symmetric)
        self._version, self.ready, self.measures = 0, False, False
        self._energy, self._sum = np.zeros(1), None  # of the last V-cycle, and the message that sums it over the ranks
        # free dofs of the coarse matrix, and the iterations with it per digit of the residual
        self._reusable, self._of, self._usual = False, tangent.kept, 0.0
        noise = np.random.default_rng(solid.comm.rank).normal(size=3 * solid.owned)
        self._noise = tangent.padded(NOISE * noise / np.sqrt(solid.dofs))
        supported = np.ones(3 * solid.owned)
        supported[solid.fixed] = 0.0
        self._supported = tangent.padded(supported)
        self._extreme, self._greatest = self._noise, 0.0

    def precondition(self, ksp: Any) -> Any:
        """Make a KSP with a prefix CG, or GMRES, on the free dofs with this preconditioner; its matrix; collective."""
        operator, prefix = self._tangent.matrix(), ksp.getOptionsPrefix()
        ksp.setType("cg" if self._symmetric else "gmres")
        ksp.getPC().setType("python")
        ksp.getPC().setPythonContext(self)
        ksp.setOperators(operator)
        if self._solid.comm.size > 1 and self._symmetric:
            set_defaults(prefix, {"ksp_cg_single_reduction": True})  # two products in one message
        ksp.setFromOptions()
        return operator

    def update(self) -> bool:
        """Adapt to the current values and free dofs of the tangent; collective.

        The coarse matrix is renewed where more than some dofs were held or released since it was made, or where `judge`
        finds it too old.

        Returns:
            whether the matrix can be smoothed, its diagonal is positive, and the coarse one solved
        """
        self.ready = self._update()
        return self.ready

    def _update(self) -> bool:
        from mpi4py import MPI

        solid, tangent = self._solid, self._tangent
        self._free = tangent.padded(tangent.free)
        new = self._version != tangent.version
        if new:
            diagonal = tangent.diagonal()
            least = -solid.comm.allreduce(float(np.max(-diagonal[tangent.free > 0.0], initial=-np.inf)), op=MPI.MAX)
            if not least > 0.0:
                return False
            self._inverse = tangent.padded(1.0 / np.where(diagonal > 0.0, diagonal, 1.0))
            self._version = tangent.version
        self._scaling = self._free * self._inverse
        changed = np.count_nonzero(self._of[: solid.owned] != tangent.kept[: solid.owned])
        if not self._reusable or summed(solid.comm, changed)[0] > max(LAG, LAG_SHARE * solid.dofs):
            coarse, corners = self._coarse, np.ascontiguousarray(tangent.kept[self._corners])
            values = np.empty(coarse.sparsity.size)
            tangent.project(self._parents, coarse.sparsity, corners, values)
            held = np.flatnonzero(corners[: self._owned_corners].ravel() == 0.0)
            values[coarse.sparsity.diagonal[held]] = 1.0  # unit rows
            self._reusable = coarse.update(values)
            if not self._reusable:
                return False
            self._of, self._usual = tangent.kept, 0.0
        # a dof that was held has a unit row in the coarse matrix
        self._coarse_free = (self._of * tangent.kept)[self._corners].ravel().astype(np.float32)
        if self._greatest == 0.0:
            self.estimate()
        elif new:
            self._greatest = max(self._greatest, self._greatest_eigenvalue(UPDATE, self._free))
        return True

    def forget(self) -> None:
        """Let the next `update` set everything up again, except for the eigenvalue of a tangent that never changed."""
        self._reusable = False
        if self._solid.tangent.version > 1 or not self._solid.tangent.constant:
            self._greatest = 0.0

    def renew(self) -> bool:
        """Set up the coarse matrix and the eigenvalue again after a solve that failed, see `update`; collective."""
        self._reusable = False
        done = self.update()
        if done:
            self.estimate()
        return done

    def factorise_coarse(self) -> bool:
        """Factorise the coarse matrix where algebraic multigrid has failed; whether it does now, collective."""
        if self._coarse.factorisation is None:
            return False
        self._coarse = self._coarse.factorisation()
        return self.renew()

    def judge(self, iterations: int, rtol: float, solved: bool) -> None:
        """Decide by the iterations of a solve to `rtol` and its success if the next one may use the same coarse matrix.

        It may while few dofs are held or released and the iterations do not increase, even if some more cells yield: a
        dof held since then is masked, one released since then is left to the smoother.
        """
        digits = max(-log10(rtol), 1.0)
        self._usual = self._usual or iterations / digits
        self._reusable = solved and iterations <= RENEWAL * self._usual * digits + 2

    def estimate(self) -> None:
        """Estimate the greatest eigenvalue from a new start vector; collective.

        It grows when cells yield (measured: from 3.6 to 4.5). The smoother uses the greatest estimate so far, because
        an estimate too large costs little, and one too small by a fifth makes the cycle indefinite. The estimate is for
        the solid without contact, a bound for any contact: prescribed dofs only lower the eigenvalue.
        """
        self._extreme = self._noise
        self._greatest = max(self._greatest, self._greatest_eigenvalue(LANCZOS, self._supported))

    def apply(self, pc: Any, r: Any, z: Any) -> None:
        """One V-cycle from zero: z approximates the solution for r; called by PETSc."""
        from mpi4py import MPI
        from petsc4py import PETSc

        if not self.ready:
            pc.setFailedReason(PETSc.PC.FailedReason.SUBPC_ERROR)
            z.set(np.inf)  # by which a KSP learns of it
            return
        x = np.zeros_like(self._free)
        left = self._free * self._tangent.padded(r.array_r)
        left -= self._free * self._smooth(x, left)
        right = self._coarse_free * (self._restriction @ left[: 4 * self._solid.owned])
        correction = self._free * (self._prolongation @ (self._coarse_free * self._coarse.solve(right)))
        x += correction
        left -= self._free * self._tangent.single_product(correction)
        self._smooth(x, left, last=True)
        z.array = self._tangent.unpadded(x)
        if self.measures:
            self.energy()
            self._energy[0] = r.array_r @ z.array_r
            if self._solid.comm.size > 1:  # on its way while the next product is made
                self._sum = self._solid.comm.Iallreduce(MPI.IN_PLACE, self._energy)

    def energy(self) -> float:
        """Product of the residual of the last V-cycle and what it made of it; collective."""
        if self._sum is not None:
            self._sum.Wait()
            self._sum = None
        return float(self._energy[0])

    def _smooth(self, x: Singles, residual: Singles, last: bool = False) -> Singles:
        """Chebyshev's iteration (Saad, Iterative Methods, 2003, algorithm 12.1) on x and its residual, in place.

        Returns:
            product with the last step, not yet subtracted from the residual; not up to date after the last smoothing
        """
        low, high = (self._greatest * part for part in SMOOTHED)
        middle, half = 0.5 * (high + low), 0.5 * (high - low)
        rho = half / middle
        step, image = np.zeros_like(x), np.zeros_like(x)
        keep, add = 0.0, 1.0 / middle
        for sweep in range(SWEEPS):
            _solver.relax(image, self._free, self._scaling, keep, add, residual, step, x)
            if not last or sweep < SWEEPS - 1:
                image = self._tangent.single_product(step)
            before, rho = rho, 1.0 / (2.0 * middle / half - rho)
            keep, add = rho * before, 2.0 * rho / half
        return image

    def _greatest_eigenvalue(self, steps: int, free: Singles) -> float:
        """Of the Jacobi-scaled matrix with those dofs free, by Lanczos' method from the last vector; collective."""
        comm, owned = self._solid.comm, 4 * self._solid.owned
        root = np.sqrt(free * self._inverse)

        def dot(a: Singles, b: Singles) -> float:
            return float(np.dot(a[:owned], b[:owned]))

        w, before = free * self._extreme, np.zeros_like(free)
        basis: list[Singles] = []
        diagonal: list[float] = []
        beside: list[float] = []
        for step in range(steps):
            image = root * self._tangent.single_product(root * w)
            square, along = summed(comm, dot(w, w), dot(w, image))
            beta = np.sqrt(square)
            if step:
                if beta <= 1e-5 * diagonal[0]:  # the space is exhausted
                    break
                beside.append(beta)
            v = w / np.float32(beta)
            basis.append(v)
            diagonal.append(along / square)
            w = image / np.float32(beta) - np.float32(diagonal[-1]) * v
            if step:
                w -= np.float32(beta) * before
            before = v
        values, vectors = np.linalg.eigh(np.diag(diagonal) + np.diag(beside, 1) + np.diag(beside, -1))
        # noise, so that a mode that has become the greatest elsewhere can grow
        self._extreme = np.stack(basis, axis=1) @ vectors[:, -1].astype(np.float32) + self._noise
        return float(values[-1])


class EnergyTest:
    """Test of convergence of CG with p-multigrid, by the energy norm of the error.

    The energy of the residual after an iteration would cost a V-cycle at the end of each solution. It is predicted
    instead: the energy falls from one iteration to the next as the square of the residual does.

    Args:
        ksp: CG; gets the test
        multigrid: its preconditioner

    Attributes:
        left: energy of the error of the last iterate
    """

    def __init__(self, ksp: Any, multigrid: PMultigrid) -> None:
        from petsc4py import PETSc

        self._multigrid, multigrid.measures = multigrid, True
        self._norm = self._first = self.left = 0.0
        ksp.setNormType(PETSc.KSP.NormType.UNPRECONDITIONED)
        ksp.setConvergenceTest(self)

    def __call__(self, ksp: Any, iteration: int, norm: float) -> int:
        """Whether the energy of the error is small enough; called by PETSc."""
        reasons = ksp.ConvergedReason
        before, self._norm = self._norm, norm
        if not np.isfinite(norm):
            return int(reasons.DIVERGED_BREAKDOWN)
        if norm == 0.0:
            self.left = 0.0
            return int(reasons.CONVERGED_ATOL)
        if iteration == 0:
            self.left = np.inf
            return int(reasons.ITERATING)
        energy = self._multigrid.energy()
        if not energy > 0.0:
            return int(reasons.DIVERGED_INDEFINITE_PC)
        if iteration == 1:
            self._first = energy
        self.left = energy * (norm / before) ** 2
        if self.left <= ksp.rtol**2 * self._first:
            return int(reasons.CONVERGED_RTOL)
        return int(reasons.ITERATING if iteration < ksp.max_it else reasons.DIVERGED_MAX_IT)
