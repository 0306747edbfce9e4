// pin.aba in a loop of its own language: `in_pinocchio.py` compiles this and fills the arrays.

#include <pinocchio/multibody.hpp>
#include <pinocchio/algorithm/aba.hpp>

using namespace pinocchio;
using Row3 = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
using Vector = Eigen::Map<const Eigen::VectorXd>;

struct Scene {
  Model model;
  Data data;
};

enum Kind { REVOLUTE_X, REVOLUTE_Y, REVOLUTE_Z, REVOLUTE, PRISMATIC, SPHERICAL, FREE };

static JointModel joint_of(int kind, const Eigen::Vector3d& axis) {
  switch (kind) {
    case REVOLUTE_X: return JointModelRX();
    case REVOLUTE_Y: return JointModelRY();
    case REVOLUTE_Z: return JointModelRZ();
    case REVOLUTE: return JointModelRevoluteUnaligned(axis);
    case PRISMATIC: return JointModelPrismaticUnaligned(axis);
    case SPHERICAL: return JointModelSpherical();
    default: return JointModelFreeFlyer();
  }
}

extern "C" {

// Arrays of n rows: parent joint, kind; placement (12: rotation row by row, then translation),
// axis (3), mass (1), centre of mass (3), inertia about it (9).
Scene* make(int n, const long* parent, const long* kind, const double* placement,
            const double* axis, const double* mass, const double* com, const double* inertia,
            const double* armature, const double* gravity) {
  auto* scene = new Scene;
  Model& model = scene->model;
  for (int i = 0; i < n; ++i) {
    const double* place = placement + 12 * i;
    const SE3 at(Eigen::Map<const Row3>(place), Eigen::Map<const Eigen::Vector3d>(place + 9));
    const Eigen::Vector3d h = Eigen::Map<const Eigen::Vector3d>(axis + 3 * i);
    const auto joint =
        model.addJoint(parent[i], joint_of(kind[i], h), at, std::to_string(i));
    const Inertia body(mass[i], Eigen::Map<const Eigen::Vector3d>(com + 3 * i),
                       Eigen::Map<const Row3>(inertia + 9 * i));
    model.appendBodyToJoint(joint, body, SE3::Identity());
  }
  model.armature = Vector(armature, model.nv);
  model.gravity.linear() = Eigen::Map<const Eigen::Vector3d>(gravity);
  scene->data = Data(model);
  return scene;
}

void forward_dynamics(Scene* scene, const double* q, const double* v, const double* tau,
                      double* vdot, int n) {
  const Model& model = scene->model;
  const Eigen::VectorXd x = Vector(q, model.nq), y = Vector(v, model.nv), t = Vector(tau, model.nv);
  for (int i = 0; i < n; ++i) aba(model, scene->data, x, y, t);
  Eigen::Map<Eigen::VectorXd>(vdot, model.nv) = scene->data.ddq;
}

}
