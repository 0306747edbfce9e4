"""Integration methods as data, with their Butcher tableaus. The kernels perform the steps.

Coefficients of DOPRI5 and DOP853: [Hairer, Norsett, Wanner 1993, II.5, II.6 and their code].
"""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from .engine import stepping
from .errors import InputError, Problem, choices, no_method

Array: TypeAlias = NDArray[np.float64]
STEPPING = stepping.__name__


class Tableau(NamedTuple):
    """The tableau for y(t + θ h) = y + h Σ k_i p_i(θ), with the stages k_i at t + c_i h.

    A step takes the first s stages, s the length of `b`; stage s is the slope at its end, and
    those after it serve dense output alone.
    """

    a: Array  # (S, S)
    b: Array  # (s,)
    c: Array  # (S,)
    error: Array  # (1 or 2, s or s + 1) weights of error estimates, empty without one
    dense: Array  # (S, degree) coefficients of p_i: θ, θ², ..., empty without dense output


class Method(NamedTuple):
    """An integration method, with its coefficients, step kernel and application."""

    name: str
    order: int
    tableau: Tableau
    use: str  # purpose in a few words
    step: str  # module and name of its kernel, loaded when it is first asked for
    adaptive: bool = False  # whether it can choose its steps by their error
    # safety, exponents of this error and the last one, least and largest change of the width
    controller: tuple[float, float, float, float, float] = (0.9, 0.0, 0.0, 0.2, 6.0)
    limit: float = 0.0  # largest stable rate x step of an oscillation, 0 for any
    implicit: bool = False  # True if it solves equations
    jacobian: bool = False  # whether it does so with the Jacobian of v'

    @property
    def kernel(self) -> Any:
        """The step kernel."""
        module, name = self.step.split(".")
        return getattr(import_module(f"{STEPPING}.{module}"), name)

    @property
    def of_duals(self) -> Any:
        """The kernel that repeats a step with derivatives."""
        module, name = self.step.split(".")
        if module == "explicit":
            return import_module(f"{STEPPING}.duals").explicit_of_duals
        where = "moreau_duals" if module == "moreau" else "implicit_duals"
        return getattr(import_module(f"{STEPPING}.{where}"), f"{name}_of_duals")

    @property
    def starts(self) -> bool:
        """Return True if a step requires v' at its start."""
        return self.name != "moreau_jean"

    @property
    def eventful(self) -> bool:
        """Return True if the method supports event location within a step."""
        return self.starts and not self.implicit

    @property
    def evaluations(self) -> int:
        """The number of dynamics evaluations per step."""
        return max(len(self.tableau.b), 1)


def _pi(order: int, last: float, most: float) -> tuple[float, float, float, float, float]:
    """Return the gains of PI control for an error as h^order ([Hairer, Wanner 1996, IV.2])."""
    return 0.9, 1.0 / order - 0.75 * last, last, 0.2, most


# -- tableaus: of Runge-Kutta methods, with error weights and polynomials for dense output ---------

NONE = np.zeros((0, 0))


def _square(rows: Sequence[dict[int, float]], size: int) -> Array:
    """Return sparse rows as a square array, in which they are the last rows."""
    found = np.zeros((size, size))
    for r, row in enumerate(rows, start=size - len(rows)):
        found[r, list(row)] = list(row.values())
    return found


def euler() -> Tableau:
    """Return an empty tableau, since semi-implicit Euler does not need one."""
    return Tableau(NONE, np.zeros(0), np.zeros(0), NONE, NONE)


def rk4() -> Tableau:
    """Return the tableau of the classical fourth-order method."""
    b = np.array([1.0, 2.0, 2.0, 1.0]) / 6.0
    return Tableau(
        _square(({0: 0.5}, {1: 0.5}, {2: 1.0}), 4), b, np.array([0.0, 0.5, 0.5, 1.0]), NONE, NONE
    )


def dopri5() -> Tableau:
    """Return a tableau of order 5 with an error estimate of order 4 and dense output of order 4."""
    a = _square(
        (
            {0: 1 / 5},
            {0: 3 / 40, 1: 9 / 40},
            {0: 44 / 45, 1: -56 / 15, 2: 32 / 9},
            {0: 19372 / 6561, 1: -25360 / 2187, 2: 64448 / 6561, 3: -212 / 729},
            {0: 9017 / 3168, 1: -355 / 33, 2: 46732 / 5247, 3: 49 / 176, 4: -5103 / 18656},
            {0: 35 / 384, 2: 500 / 1113, 3: 125 / 192, 4: -2187 / 6784, 5: 11 / 84},
        ),
        7,
    )
    fourth = [5179 / 57600, 0.0, 7571 / 16695, 393 / 640, -92097 / 339200, 187 / 2100, 1 / 40]
    d = [
        -12715105075 / 11282082432,
        0.0,
        87487479700 / 32700410799,
        -10690763975 / 1880347072,
        701980252875 / 199316789632,
        -1453857185 / 822651844,
        69997945 / 29380423,
    ]
    return Tableau(
        a,
        a[6, :6].copy(),
        np.array([0.0, 0.2, 0.3, 0.8, 8 / 9, 1.0, 1.0]),
        (a[6] - fourth)[None],
        _interpolant(a[6], 6, np.array([d])),
    )


def dop853() -> Tableau:
    """Return a tableau of order 8 with errors of orders 5 and 3 and dense output of order 7."""
    a = _square(DOP853_A, 16)
    third = np.zeros(12)
    third[[0, 8, 11]] = DOP853_THIRD
    error = np.array([_square(DOP853_E, 12)[-1], a[12, :12] - third])
    return Tableau(
        a,
        a[12, :12].copy(),
        a.sum(axis=1),
        error,
        _interpolant(a[12], 12, _square(DOP853_D, 16)[-4:]),
    )


def _interpolant(b: Array, end: int, d: Array) -> Array:
    """Return p_i in powers of θ, from the cubic Hermite interpolant between both ends and the terms
    in `d`.

    The polynomial is y + θ (Δ + (1 - θ) (h k_0 - Δ + θ (2 Δ - h (k_0 + k_end)
    + (1 - θ) (h d_0 k + θ ...)))) with Δ = h Σ b_i k_i.
    """
    unit = np.eye(len(b))
    parts = [b, unit[0] - b, 2 * b - unit[end] - unit[0], *d]
    powers = np.zeros((len(b), len(parts) + 1))
    for n in range(len(parts) - 1, -1, -1):
        powers[:, 0] += parts[n]
        shifted = np.roll(powers, 1, axis=1)
        powers = shifted if n % 2 == 0 else powers - shifted
    return powers[:, 1:].copy()


def radau5() -> Tableau:
    """Return the tableau of Radau IIA of order 5, with collocation at `c`."""
    r = np.sqrt(6.0)
    a = np.array(
        [
            [(88 - 7 * r) / 360, (296 - 169 * r) / 1800, (-2 + 3 * r) / 225],
            [(296 + 169 * r) / 1800, (88 + 7 * r) / 360, (-2 - 3 * r) / 225],
            [(16 - r) / 36, (16 + r) / 36, 1 / 9],
        ]
    )
    error = np.array([[-13 - 7 * r, -13 + 7 * r, -1.0]]) / 3.0
    c = np.array([(4 - r) / 10, (4 + r) / 10, 1.0])
    return Tableau(_decoupled(a), a[2].copy(), c, error, NONE)


def _decoupled(a: Array) -> Array:
    """Return T and T⁻¹, which diagonalise A⁻¹, with its real and a complex eigenvalue, as a (7, 3)
    array.

    A⁻¹ = T Λ T⁻¹; as a complex number, the second and third of T⁻¹ z are multiplied by the
    complex eigenvalue ([Hairer, Wanner 1996, IV.8]).
    """
    values, vectors = np.linalg.eig(np.linalg.inv(a))
    real, pair = np.argmin(np.abs(np.imag(values))), np.argmax(np.imag(values))
    u = vectors[:, pair]
    t = np.column_stack((np.real(vectors[:, real]), np.real(u), -np.imag(u)))
    last = [np.real(values[real]), np.real(values[pair]), np.imag(values[pair])]
    return np.vstack((t, np.linalg.inv(t), last))


def gauss6() -> Tableau:
    """Return three-stage Gauss collocation, symplectic, order 6 ([Hairer et al. 2006, II.1.3])."""
    r = np.sqrt(15.0)
    a = np.array(
        [
            [5 / 36, 2 / 9 - r / 15, 5 / 36 - r / 30],
            [5 / 36 + r / 24, 2 / 9, 5 / 36 - r / 24],
            [5 / 36 + r / 30, 2 / 9 + r / 15, 5 / 36],
        ]
    )
    c = np.array([0.5 - r / 10, 0.5, 0.5 + r / 10])
    return Tableau(a, np.array([5.0, 8.0, 5.0]) / 18.0, c, NONE, NONE)


DOP853_THIRD = (0.244094488188976377952755905512, 0.733846688281611857341361741547,
                0.220588235294117647058823529412e-1)  # fmt: skip
# {column: number} a row
DOP853_A = (
    {0: 5.26001519587677318785587544488e-2},
    {0: 1.97250569845378994544595329183e-2, 1: 5.91751709536136983633785987549e-2},
    {0: 2.95875854768068491816892993775e-2, 2: 8.87627564304205475450678981324e-2},
    {
        0: 2.41365134159266685502369798665e-1, 2: -8.84549479328286085344864962717e-1,
        3: 9.24834003261792003115737966543e-1,
    },
    {
        0: 3.7037037037037037037037037037e-2, 3: 1.70828608729473871279604482173e-1,
        4: 1.25467687566822425016691814123e-1,
    },
    {
        0: 3.7109375e-2, 3: 1.70252211019544039314978060272e-1,
        4: 6.02165389804559606850219397283e-2, 5: -1.7578125e-2,
    },
    {
        0: 3.70920001185047927108779319836e-2, 3: 1.70383925712239993810214054705e-1,
        4: 1.07262030446373284651809199168e-1, 5: -1.53194377486244017527936158236e-2,
        6: 8.27378916381402288758473766002e-3,
    },
    {
        0: 6.24110958716075717114429577812e-1, 3: -3.36089262944694129406857109825,
        4: -8.68219346841726006818189891453e-1, 5: 2.75920996994467083049415600797e1,
        6: 2.01540675504778934086186788979e1, 7: -4.34898841810699588477366255144e1,
    },
    {
        0: 4.77662536438264365890433908527e-1, 3: -2.48811461997166764192642586468,
        4: -5.90290826836842996371446475743e-1, 5: 2.12300514481811942347288949897e1,
        6: 1.52792336328824235832596922938e1, 7: -3.32882109689848629194453265587e1,
        8: -2.03312017085086261358222928593e-2,
    },
    {
        0: -9.3714243008598732571704021658e-1, 3: 5.18637242884406370830023853209,
        4: 1.09143734899672957818500254654, 5: -8.14978701074692612513997267357,
        6: -1.85200656599969598641566180701e1, 7: 2.27394870993505042818970056734e1,
        8: 2.49360555267965238987089396762, 9: -3.0467644718982195003823669022,
    },
    {
        0: 2.27331014751653820792359768449, 3: -1.05344954667372501984066689879e1,
        4: -2.00087205822486249909675718444, 5: -1.79589318631187989172765950534e1,
        6: 2.79488845294199600508499808837e1, 7: -2.85899827713502369474065508674,
        8: -8.87285693353062954433549289258, 9: 1.23605671757943030647266201528e1,
        10: 6.43392746015763530355970484046e-1,
    },
    {
        0: 5.42937341165687622380535766363e-2, 5: 4.45031289275240888144113950566,
        6: 1.89151789931450038304281599044, 7: -5.8012039600105847814672114227,
        8: 3.1116436695781989440891606237e-1, 9: -1.52160949662516078556178806805e-1,
        10: 2.01365400804030348374776537501e-1, 11: 4.47106157277725905176885569043e-2,
    },
    {
        0: 5.61675022830479523392909219681e-2, 6: 2.53500210216624811088794765333e-1,
        7: -2.46239037470802489917441475441e-1, 8: -1.24191423263816360469010140626e-1,
        9: 1.5329179827876569731206322685e-1, 10: 8.20105229563468988491666602057e-3,
        11: 7.56789766054569976138603589584e-3, 12: -8.298e-3,
    },
    {
        0: 3.18346481635021405060768473261e-2, 5: 2.83009096723667755288322961402e-2,
        6: 5.35419883074385676223797384372e-2, 7: -5.49237485713909884646569340306e-2,
        10: -1.08347328697249322858509316994e-4, 11: 3.82571090835658412954920192323e-4,
        12: -3.40465008687404560802977114492e-4, 13: 1.41312443674632500278074618366e-1,
    },
    {
        0: -4.28896301583791923408573538692e-1, 5: -4.69762141536116384314449447206,
        6: 7.68342119606259904184240953878, 7: 4.06898981839711007970213554331,
        8: 3.56727187455281109270669543021e-1, 12: -1.39902416515901462129418009734e-3,
        13: 2.9475147891527723389556272149, 14: -9.15095847217987001081870187138,
    },
)  # fmt: skip
DOP853_D = (
    {
        0: -0.84289382761090128651353491142e1, 5: 0.56671495351937776962531783590,
        6: -0.30689499459498916912797304727e1, 7: 0.23846676565120698287728149680e1,
        8: 0.21170345824450282767155149946e1, 9: -0.87139158377797299206789907490,
        10: 0.22404374302607882758541771650e1, 11: 0.63157877876946881815570249290,
        12: -0.88990336451333310820698117400e-1, 13: 0.18148505520854727256656404962e2,
        14: -0.91946323924783554000451984436e1, 15: -0.44360363875948939664310572000e1,
    },
    {
        0: 0.10427508642579134603413151009e2, 5: 0.24228349177525818288430175319e3,
        6: 0.16520045171727028198505394887e3, 7: -0.37454675472269020279518312152e3,
        8: -0.22113666853125306036270938578e2, 9: 0.77334326684722638389603898808e1,
        10: -0.30674084731089398182061213626e2, 11: -0.93321305264302278729567221706e1,
        12: 0.15697238121770843886131091075e2, 13: -0.31139403219565177677282850411e2,
        14: -0.93529243588444783865713862664e1, 15: 0.35816841486394083752465898540e2,
    },
    {
        0: 0.19985053242002433820987653617e2, 5: -0.38703730874935176555105901742e3,
        6: -0.18917813819516756882830838328e3, 7: 0.52780815920542364900561016686e3,
        8: -0.11573902539959630126141871134e2, 9: 0.68812326946963000169666922661e1,
        10: -0.10006050966910838403183860980e1, 11: 0.77771377980534432092869265740,
        12: -0.27782057523535084065932004339e1, 13: -0.60196695231264120758267380846e2,
        14: 0.84320405506677161018159903784e2, 15: 0.11992291136182789328035130030e2,
    },
    {
        0: -0.25693933462703749003312586129e2, 5: -0.15418974869023643374053993627e3,
        6: -0.23152937917604549567536039109e3, 7: 0.35763911791061412378285349910e3,
        8: 0.93405324183624310003907691704e2, 9: -0.37458323136451633156875139351e2,
        10: 0.10409964950896230045147246184e3, 11: 0.29840293426660503123344363579e2,
        12: -0.43533456590011143754432175058e2, 13: 0.96324553959188282948394950600e2,
        14: -0.39177261675615439165231486172e2, 15: -0.14972683625798562581422125276e3,
    },
)  # fmt: skip
DOP853_E = (
    {
        0: 0.1312004499419488073250102996e-1, 5: -0.1225156446376204440720569753e1,
        6: -0.4957589496572501915214079952, 7: 0.1664377182454986536961530415e1,
        8: -0.3503288487499736816886487290, 9: 0.3341791187130174790297318841,
        10: 0.8192320648511571246570742613e-1, 11: -0.2235530786388629525884427845e-1,
    },
)  # fmt: skip


# -- methods ---------------------------------------------------------------------------------------


METHODS = {
    method.name: method
    for method in (
        Method(
            "semi_implicit_euler", 1, euler(),
            "playback and long runs without drift of energy, at low accuracy",
            "explicit.semi_implicit", limit=2.0,
        ),
        Method(
            "rk4", 4, rk4(), "smooth motion at a fixed step",
            "explicit.runge_kutta", limit=2.83,
        ),
        Method(
            "dopri5", 5, dopri5(),
            "smooth motion to three to six digits, tables with many corners",
            "explicit.runge_kutta", adaptive=True, controller=_pi(5, 0.04, 10.0), limit=1.0,
        ),
        Method(
            "dop853", 8, dop853(), "smooth motion to six digits and more",
            "explicit.runge_kutta", adaptive=True, controller=_pi(8, 0.04, 6.0), limit=4.5,
        ),
        Method(
            "gauss6", 6, gauss6(),
            "conservative trees for very long: symplectic, the energy stays within a bound",
            "gauss.gauss", limit=3.0, implicit=True,
        ),
        Method(
            "radau5", 5, radau5(),
            "stiff springs, dampers and friction, at steps that do not resolve them",
            "implicit.radau", adaptive=True, controller=_pi(4, 0.04, 8.0), implicit=True,
            jacobian=True,
        ),
        Method(
            "moreau_jean", 1, euler(), "rigid contacts, joint limits and impacts, many at once",
            "moreau.moreau_jean", limit=2.0,
        ),
    )
}  # fmt: skip
RK4, DOPRI5, DOP853, RADAU5 = (METHODS[name] for name in ("rk4", "dopri5", "dop853", "radau5"))


def method_of(name: str, *, impulses: bool = False, touching: bool = True) -> Method:
    """Return the method `name` for a scene with `impulses` or `touching` contacts.

    Raises InputError with the choices.
    """
    if name not in METHODS:
        raise InputError(Problem("simulate", "method", no_method(name, ("auto", *METHODS))))
    if impulses and name != "moreau_jean" and not METHODS[name].eventful:
        text = f"{name} cannot take impulses: the scene has rigid contacts or joint limits, and it "
        text += "has no dense output to find them on; use 'moreau_jean', 'auto', or from event to "
        text += f"event {choices(m.name for m in METHODS.values() if m.eventful)}"
        raise InputError(Problem("simulate", "method", text))
    if name == "moreau_jean" and not touching:
        text = "moreau_jean is for impulses, and no contact, limit or joint friction acts here; "
        text += "use 'auto', or 'semi_implicit_euler', which also takes fixed steps of order 1"
        raise InputError(Problem("simulate", "method", text))
    return METHODS[name]
