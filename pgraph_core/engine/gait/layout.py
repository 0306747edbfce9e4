"""The columns of what the walking controller takes; `layout` has those of everything else.

Heading axes: x where the trunk points, level; y up; z to the right. World axes turned about y.
"""

# settings: float64 (64,), what a person may change between steps is here
CLOCK_T, CLOCK_PHASE, STRIDE = 0, 1, 2  # [s]; part of a stride done at CLOCK_T; [s]
SPEED_FROM, SPEED_TO, SPEED_T, SPEED_RATE = 3, 4, 5, 6  # a ramp from SPEED_T on [m/s, m/s²]
DRIFT = 7  # speed to the right [m/s]
HEADING, TURN, TURN_T = 8, 9, 10  # of TURN_T [rad], and its rate [rad/s]
HEIGHT = 11  # of the centre of mass over the ground under it [m]
CLEARANCE, LANDING = 12, 13  # of a swinging foot [m]; its speed down at the end [m/s]
RAMP = 14  # part of a stance over which its load comes, and goes
WIDTH = 15  # how far feet stand outside of their hips [m]
GRIP, LEAST = 16, 17  # friction that forces may ask for; least load of a foot on the ground [N]
MASS, INERTIA, PITCH = 18, 19, 22  # of all bodies [kg]; 3, about their centre; trunk's at home
GAIN_SPEED, GAIN_DRIFT, GAIN_SWAY = 23, 24, 25  # [1/s, 1/s, 1/s²]
GAIN_HEIGHT, GAIN_ROLL, GAIN_PITCH, GAIN_YAW = 26, 28, 30, 32  # 2 each: [1/s², 1/s]
GAIN_SWING, GAIN_SPINE, GAIN_PAW = 34, 36, 38  # 2 each: [1/s², 1/s]
PLACE, PLACE_DRIFT, PLACE_ROLL = 40, 41, 42  # touchdown ahead of speed errors [s, s], roll [m]
TIGHT_TORQUE, TIGHT_FORCE = 43, 44  # how closely the trunk's torque and force are met
LEVER = 45  # 1: hips spread, so that feet push sideways; 0: all hinges are parallel
LIMP = 46  # damping of all joints once it has fallen [N m s/rad]
GAIN_SURGE = 49  # towards the middle of the feet, as GAIN_SWAY [1/s²]
LOW, UPRIGHT = 47, 48  # a fall: lower than this part of HEIGHT, or more tilted than this cosine
SETTINGS = 64

# waves: float64 (5, 8): a1, b1, a2, b2, ...: Σ a cos(2π k phase) + b sin(2π k phase)
RISE, NOD, SWAY, SURGE, FLEXION = 0, 1, 2, 3, 4  # of height, pitch, place, place, spine hinges
HARMONICS = 4

# Four feet: the front ones first.
# legs_i: int64 (4, 8): rows of the trunk's body, the hip, the foot; places in q and v of the
# spreading motion (v: -1 where there is none) and of the first of three hinges about z
GIRDLE, HIP, FOOT, Q_SPREAD, V_SPREAD, Q_FLEX, V_FLEX = 0, 1, 2, 3, 4, 5, 6
LEG_I = 8
# legs_f: float64 (4, 18), home axes; the paw moves parallel to the thigh in swing
OFFSET, DUTY = 0, 1  # touchdown as a part of the stride; part of the stride on the ground
SIDE, AHEAD = 2, 3  # -1 left, 1 right; touchdown ahead of the hip at rest [m]
LONG, SHANK, THIGH, PAW = 4, 6, 8, 10  # 2 each: thigh + paw, middle segment, thigh, paw [m]
TIP = 12  # 3, of the foot's row [m]
SHARE = 15  # of the weight, at full load
LEG_F = 18

# feet: float64 (4, 12), heading axes
PLACE_F, SPEED_F, FORCE_F = 0, 3, 6  # 3 each: position, velocity, force on the foot
LOAD, SWING = 9, 10  # share of its stance's full load, 0 to 1; part of the swing done, -1 in stance
FOOT_F = 12

# spine: int64 (ns, 2): places in q and v
# fallen: float64 (1,): when it fell [s], -1 where it stands
