// A system for Gazebo (gz-sim 8): an RGBD camera's pictures as a real, cheap, moving camera delivers them. Its poses are those of
// every physics step, so that each line of the picture is taken from where the camera was then.
//
//   <sensor name="eye" type="rgbd_camera"> <topic>eye</topic> ...
//     <plugin filename="rolling_camera" name="rolling_camera::RollingCamera">
//       <topic>eye</topic> <camera>phone.toml</camera>     publishes eye/delivered
//       <readout_time_s>0.02</readout_time_s> <exposure_time_s>0.005</exposure_time_s>     as in phone.toml
//     </plugin> </sensor>
//
//   c++ -std=c++17 -shared -fPIC rolling_camera.cc -o librolling_camera.so $(pkg-config --cflags --libs shutterbug gz-sim8)
//
// This was NOT run in Gazebo: the project's tests compile it against small stand-ins for Gazebo's headers (tests/c/gazebo), call it
// as Gazebo would, and look at the picture that it publishes. phone.toml has the size and pinhole of the RGBD camera; what lies
// beyond its picture is not known, so the border is repeated.
#include <shutterbug.h>

#include <gz/msgs/image.pb.h>
#include <gz/plugin/Register.hh>
#include <gz/sim/System.hh>
#include <gz/sim/Util.hh>
#include <gz/transport/Node.hh>

#include <chrono>
#include <cmath>
#include <deque>
#include <fstream>
#include <iterator>
#include <memory>
#include <mutex>
#include <stdexcept>
#include <string>
#include <vector>

namespace rolling_camera {

template <class T> T sized() { T value{}; value.struct_size = sizeof(T); return value; }

inline void must(shutterbug_status status, const void *handle) {
    if (status == SHUTTERBUG_OK) return;
    std::string text(shutterbug_last_error(handle, nullptr, 0) + 1, '\0');
    shutterbug_last_error(handle, text.data(), text.size());
    throw std::runtime_error(std::string(shutterbug_status_text(status)) + ": " + text.c_str());
}

inline double seconds(const gz::msgs::Image &image) { return image.header().stamp().sec() + 1e-9 * image.header().stamp().nsec(); }

// A picture of Gazebo's where it lies in its message.
inline shutterbug_image borrowed(const gz::msgs::Image &image, uint32_t format) {
    auto picture = sized<shutterbug_image>();
    picture.format = format, picture.width = image.width(), picture.height = image.height();
    picture.stride_bytes = image.step(), picture.capacity_bytes = image.data().size();
    picture.pixels = const_cast<char *>(image.data().data());
    return picture;
}

struct Destroy {
    void operator()(shutterbug_engine *e) const { shutterbug_engine_destroy(e); }
    void operator()(shutterbug_frame *f) const { shutterbug_frame_destroy(f); }
};

class RollingCamera : public gz::sim::System, public gz::sim::ISystemConfigure, public gz::sim::ISystemPostUpdate {
  public:
    void Configure(const gz::sim::Entity &entity, const std::shared_ptr<const sdf::Element> &sdf, gz::sim::EntityComponentManager &,
                   gz::sim::EventManager &) override {
        entity_ = entity;
        const auto topic = sdf->Get<std::string>("topic", "camera").first;
        const auto camera = sdf->Get<std::string>("camera", "camera.toml").first;
        auto options = sized<shutterbug_engine_options>();
        char text[1024] = "";
        options.error_text = text, options.error_capacity = sizeof text;
        shutterbug_engine *made = nullptr;
        if (shutterbug_engine_create(&options, &made) != SHUTTERBUG_OK) throw std::runtime_error(text);
        engine_.reset(made);
        std::ifstream file(camera);
        if (!file) throw std::runtime_error("rolling_camera: " + camera + " cannot be read");
        const std::string toml((std::istreambuf_iterator<char>(file)), std::istreambuf_iterator<char>());
        must(shutterbug_engine_set_camera_text(made, toml.c_str()), made);
        half_s_ = 0.5 * (sdf->Get<double>("readout_time_s", 0.0).first + sdf->Get<double>("exposure_time_s", 0.0).first);
        publisher_ = node_.Advertise<gz::msgs::Image>(topic + "/delivered");
        node_.Subscribe(topic + "/image", &RollingCamera::OnColor, this);
        node_.Subscribe(topic + "/depth_image", &RollingCamera::OnDepth, this);
    }

    // After each physics step: where the camera is now. Frames whose last line has closed are delivered.
    void PostUpdate(const gz::sim::UpdateInfo &info, const gz::sim::EntityComponentManager &components) override {
        if (info.paused) return;
        const double now_s = std::chrono::duration<double>(info.simTime).count();
        const auto pose = gz::sim::worldPose(entity_, components);
        const double values[] = {pose.Pos().X(), pose.Pos().Y(), pose.Pos().Z(), pose.Rot().X(), pose.Rot().Y(), pose.Rot().Z(), pose.Rot().W()};
        auto convention = sized<shutterbug_pose_convention>();
        convention.axes = SHUTTERBUG_AXES_ROBOT; // Gazebo's sensors look along x, with z up
        shutterbug_stamped_pose stamped{now_s, {}};
        must(shutterbug_pose_convert(&convention, values, &stamped.world_from_camera, nullptr, 0), nullptr);
        path_.push_back(stamped);
        while (path_.size() > 2 && path_[1].time_s < now_s - kept_s) path_.pop_front();
        Deliver(now_s);
    }

  private:
    // Callbacks of gz-transport come from threads of its own.
    void OnColor(const gz::msgs::Image &image) { Keep(colors_, image); }
    void OnDepth(const gz::msgs::Image &image) { Keep(depths_, image); }

    void Keep(std::deque<gz::msgs::Image> &images, const gz::msgs::Image &image) {
        std::lock_guard<std::mutex> held(mutex_);
        images.push_back(image);
        if (images.size() > 8) images.pop_front(); // the other of the pair never came
    }

    void Deliver(double now_s) {
        std::lock_guard<std::mutex> held(mutex_);
        while (!colors_.empty() && !depths_.empty()) {
            const double color_s = seconds(colors_.front()), depth_s = seconds(depths_.front());
            if (std::abs(color_s - depth_s) > 1e-6) {
                (color_s < depth_s ? colors_ : depths_).pop_front();
                continue;
            }
            if (now_s < color_s + half_s_) return;
            if (path_.front().time_s <= color_s - half_s_) Publish(colors_.front(), depths_.front(), color_s);
            colors_.pop_front(), depths_.pop_front();
        }
    }

    // Gazebo's picture shows the middle of the frame: no line is further from it than half a readout.
    void Publish(const gz::msgs::Image &color, const gz::msgs::Image &depth, double color_s) {
        if (color.pixel_format_type() != gz::msgs::RGB_INT8 || depth.pixel_format_type() != gz::msgs::R_FLOAT32)
            throw std::runtime_error("rolling_camera: RGB_INT8 with R_FLOAT32 is expected of an rgbd_camera");
        const auto colors = borrowed(color, SHUTTERBUG_RGB8), depths = borrowed(depth, SHUTTERBUG_R32F);
        const std::vector<shutterbug_stamped_pose> poses(path_.begin(), path_.end());
        auto outside = sized<shutterbug_outside>();
        outside.frame_index = frames_++;
        outside.time_s = color_s - half_s_, outside.color_time_s = color_s;
        const auto metres = sized<shutterbug_depth_convention>(); // along the optical axis, as Gazebo's
        outside.color = &colors, outside.depth = &depths, outside.depth_convention = &metres;
        outside.poses = poses.data(), outside.pose_count = uint32_t(poses.size());
        outside.flags = SHUTTERBUG_OUTSIDE_REPEAT_BORDER;
        shutterbug_frame *made = nullptr;
        must(shutterbug_engine_submit_outside(engine_.get(), &outside, &made), engine_.get());
        const std::unique_ptr<shutterbug_frame, Destroy> frame(made);
        must(shutterbug_frame_wait(made, -1), made);
        gz::msgs::Image delivered(color); // header, size, format
        std::string pixels(color.data().size(), '\0');
        auto to = borrowed(color, SHUTTERBUG_RGB8);
        to.pixels = pixels.data();
        must(shutterbug_frame_read(made, SHUTTERBUG_PICTURE, &to), made);
        delivered.set_data(pixels);
        publisher_.Publish(delivered);
    }

    static constexpr double kept_s = 1.0;
    gz::sim::Entity entity_{};
    std::unique_ptr<shutterbug_engine, Destroy> engine_;
    std::deque<shutterbug_stamped_pose> path_;
    double half_s_ = 0;
    uint32_t frames_ = 0;
    std::mutex mutex_; // of the two below
    std::deque<gz::msgs::Image> colors_, depths_;
    gz::transport::Node::Publisher publisher_;
    gz::transport::Node node_; // last: its callbacks end before the rest goes
};

} // namespace rolling_camera

GZ_ADD_PLUGIN(rolling_camera::RollingCamera, gz::sim::System, rolling_camera::RollingCamera::ISystemConfigure,
              rolling_camera::RollingCamera::ISystemPostUpdate)
