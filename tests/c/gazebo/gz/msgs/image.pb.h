// A stand-in for gz-msgs: an image as protobuf would have it.
#pragma once
#include <cstdint>
#include <string>
namespace gz::msgs {
enum PixelFormatType { UNKNOWN_PIXEL_FORMAT = 0, RGB_INT8 = 3, R_FLOAT32 = 13 };
class Time {
  public:
    int64_t sec() const { return sec_; }
    int32_t nsec() const { return nsec_; }
    void set_sec(int64_t v) { sec_ = v; }
    void set_nsec(int32_t v) { nsec_ = v; }
  private:
    int64_t sec_ = 0;
    int32_t nsec_ = 0;
};
class Header {
  public:
    const Time &stamp() const { return stamp_; }
    Time *mutable_stamp() { return &stamp_; }
  private:
    Time stamp_;
};
class Image {
  public:
    const Header &header() const { return header_; }
    Header *mutable_header() { return &header_; }
    uint32_t width() const { return width_; }
    uint32_t height() const { return height_; }
    uint32_t step() const { return step_; }
    const std::string &data() const { return data_; }
    PixelFormatType pixel_format_type() const { return format_; }
    void set_width(uint32_t v) { width_ = v; }
    void set_height(uint32_t v) { height_ = v; }
    void set_step(uint32_t v) { step_ = v; }
    void set_data(const std::string &v) { data_ = v; }
    void set_pixel_format_type(PixelFormatType v) { format_ = v; }
  private:
    Header header_;
    uint32_t width_ = 0, height_ = 0, step_ = 0;
    std::string data_;
    PixelFormatType format_ = UNKNOWN_PIXEL_FORMAT;
};
} // namespace gz::msgs
