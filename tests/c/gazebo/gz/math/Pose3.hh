// A stand-in for gz-math.
#pragma once
namespace gz::math {
class Vector3d {
  public:
    Vector3d(double x, double y, double z) : x_(x), y_(y), z_(z) {}
    double X() const { return x_; }
    double Y() const { return y_; }
    double Z() const { return z_; }
  private:
    double x_, y_, z_;
};
class Quaterniond {
  public:
    Quaterniond(double w, double x, double y, double z) : w_(w), x_(x), y_(y), z_(z) {}
    double W() const { return w_; }
    double X() const { return x_; }
    double Y() const { return y_; }
    double Z() const { return z_; }
  private:
    double w_, x_, y_, z_;
};
class Pose3d {
  public:
    Pose3d(Vector3d p, Quaterniond q) : p_(p), q_(q) {}
    const Vector3d &Pos() const { return p_; }
    const Quaterniond &Rot() const { return q_; }
  private:
    Vector3d p_;
    Quaterniond q_;
};
} // namespace gz::math
