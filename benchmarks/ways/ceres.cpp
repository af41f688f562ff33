// Calibrations by Ceres: automatic derivatives, one problem for each calibration.
//
// Built and called by ceres.py. Both functions take `count` sessions of `n` positions, forces
// (count, n, 3) and angles (count, n, 2), and write estimates and standard deviations a posteriori,
// (2, count, 9). Without `robot` they do not look at the angles.

#include <ceres/ceres.h>
#include <ceres/tiny_solver.h>
#include <ceres/tiny_solver_autodiff_function.h>

#include <cmath>
#include <limits>

namespace {

constexpr int kParameters = 9;

struct Settings {
  double gravity, sigma_force, sigma_angle;
};

// f_b of the sensor's output: eq. (4) and (5) of Thalmann & Neuner (2018).
template <typename T>
Eigen::Matrix<T, 3, 1> BodyForce(const T* x, const double* output) {
  T f_a[3];
  for (int k = 0; k < 3; ++k) f_a[k] = (output[k] - x[k]) / (1.0 + x[3 + k]);
  return {f_a[0] - x[6] * f_a[1] + x[7] * f_a[2], f_a[1] - x[8] * f_a[2], f_a[2]};
}

// (|f_b| - g) / σ.
struct Gravity {
  static constexpr int kResiduals = 1;

  Gravity(const double* forces, const double*, const Settings& settings)
      : forces(forces), settings(settings) {}

  template <typename T>
  bool operator()(const T* x, T* residuals) const {
    residuals[0] = (BodyForce(x, forces).norm() - settings.gravity) / settings.sigma_force;
    return true;
  }

  const double* forces;
  Settings settings;
};

// f_b - f(φ, θ), whitened with its covariance matrix at the angles that the robot read.
struct Robot {
  static constexpr int kResiduals = 3;

  Robot(const double* forces, const double* angles, const Settings& settings) : forces(forces) {
    const double g = settings.gravity, roll = angles[0], pitch = angles[1];
    told << g * std::sin(pitch), -g * std::cos(pitch) * std::sin(roll),
        -g * std::cos(pitch) * std::cos(roll);
    Eigen::Matrix<double, 3, 2> by_angles;
    by_angles << 0.0, g * std::cos(pitch),  //
        told(2), g * std::sin(pitch) * std::sin(roll),
        -told(1), g * std::sin(pitch) * std::cos(roll);
    Eigen::Matrix3d covariance =
        settings.sigma_angle * settings.sigma_angle * by_angles * by_angles.transpose();
    covariance.diagonal().array() += settings.sigma_force * settings.sigma_force;
    const Eigen::Matrix3d lower = covariance.llt().matrixL();
    whitening = lower.inverse();
  }

  template <typename T>
  bool operator()(const T* x, T* residuals) const {
    const Eigen::Matrix<T, 3, 1> misfit = BodyForce(x, forces) - told.cast<T>();
    Eigen::Map<Eigen::Matrix<T, 3, 1>> white(residuals);
    white = whitening.cast<T>() * misfit;
    return true;
  }

  const double* forces;
  Eigen::Vector3d told;
  Eigen::Matrix3d whitening;
};

// One problem and one covariance for each calibration.
template <typename Condition>
void WithProblem(int count, int n, const double* forces, const double* angles,
                 const Settings& settings, double* results) {
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_QR;
  options.num_threads = 1;
  options.logging_type = ceres::SILENT;
  ceres::Covariance::Options covariance_options;
  covariance_options.algorithm_type = ceres::DENSE_SVD;
  covariance_options.num_threads = 1;
  for (int session = 0; session < count; ++session) {
    double* x = results + kParameters * session;
    double* sigma = results + kParameters * (count + session);
    std::fill(x, x + kParameters, 0.0);
    ceres::Problem problem;
    for (int i = 0; i < n; ++i) {
      const int row = session * n + i;
      problem.AddResidualBlock(
          new ceres::AutoDiffCostFunction<Condition, Condition::kResiduals, kParameters>(
              new Condition(forces + 3 * row, angles + 2 * row, settings)),
          nullptr, x);
    }
    ceres::Solver::Summary summary;
    ceres::Solve(options, &problem, &summary);
    ceres::Covariance covariance(covariance_options);
    const std::vector<const double*> blocks{x};
    double cofactors[kParameters * kParameters];
    if (!summary.IsSolutionUsable() || !covariance.Compute(blocks, &problem) ||
        !covariance.GetCovarianceBlock(x, x, cofactors)) {
      std::fill(x, x + kParameters, std::numeric_limits<double>::quiet_NaN());
      continue;
    }
    const int redundancy = n * Condition::kResiduals - kParameters;
    const double variance = 2 * summary.final_cost / redundancy;
    for (int k = 0; k < kParameters; ++k)
      sigma[k] = std::sqrt(variance * cofactors[k * (kParameters + 1)]);
  }
}

// All residuals of a session, as `TinySolver` wants them.
template <typename Condition>
struct AllConditions {
  template <typename T>
  bool operator()(const T* x, T* residuals) const {
    for (const Condition& condition : conditions) {
      condition(x, residuals);
      residuals += Condition::kResiduals;
    }
    return true;
  }

  int NumResiduals() const { return Condition::kResiduals * static_cast<int>(conditions.size()); }

  std::vector<Condition> conditions;
};

// The solver that Ceres has for many small problems: no problem to build, no memory to ask for.
template <typename Condition>
void WithTinySolver(int count, int n, const double* forces, const double* angles,
                    const Settings& settings, double* results) {
  using Function =
      ceres::TinySolverAutoDiffFunction<AllConditions<Condition>, Eigen::Dynamic, kParameters>;
  ceres::TinySolver<Function> solver;
  AllConditions<Condition> all;
  Eigen::VectorXd residuals(Condition::kResiduals * n);
  Eigen::Matrix<double, Eigen::Dynamic, kParameters> jacobian(residuals.size(), kParameters);
  for (int session = 0; session < count; ++session) {
    all.conditions.clear();
    for (int row = session * n; row < (session + 1) * n; ++row)
      all.conditions.emplace_back(forces + 3 * row, angles + 2 * row, settings);
    Function function(all);
    Eigen::Matrix<double, kParameters, 1> x = Eigen::Matrix<double, kParameters, 1>::Zero();
    solver.Solve(function, &x);
    function(x.data(), residuals.data(), jacobian.data());
    const Eigen::Matrix<double, kParameters, kParameters> normal = jacobian.transpose() * jacobian;
    const double variance = residuals.squaredNorm() / (residuals.size() - kParameters);
    Eigen::Map<Eigen::Matrix<double, kParameters, 1>> estimates(results + kParameters * session);
    Eigen::Map<Eigen::Matrix<double, kParameters, 1>> sigma(results +
                                                            kParameters * (count + session));
    estimates = x;
    sigma = (variance * normal.inverse().diagonal()).cwiseSqrt();
  }
}

}  // namespace

extern "C" void problem(int robot, int count, int n, const double* forces, const double* angles,
                        double gravity, double sigma_force, double sigma_angle, double* results) {
  const Settings settings{gravity, sigma_force, sigma_angle};
  (robot ? WithProblem<Robot> : WithProblem<Gravity>)(count, n, forces, angles, settings, results);
}

extern "C" void tiny_solver(int robot, int count, int n, const double* forces,
                            const double* angles, double gravity, double sigma_force,
                            double sigma_angle, double* results) {
  const Settings settings{gravity, sigma_force, sigma_angle};
  (robot ? WithTinySolver<Robot> : WithTinySolver<Gravity>)(count, n, forces, angles, settings,
                                                            results);
}
