// Memory for kernels: zeros, aligned to a cache line, taken once.
#pragma once
#include <stickslip/errors.h>

#include <cstring>
#include <memory>
#include <new>
#include <string>

namespace stickslip::world {

class AlignedBlock {
 public:
  AlignedBlock() = default;
  /// Throws ModelError where memory is short.
  explicit AlignedBlock(std::size_t bytes) : bytes_(bytes) {
    void* p = ::operator new(bytes_, std::align_val_t(kLine), std::nothrow);
    if (!p)
      throw ModelError("no memory for " + std::to_string(bytes) +
                       " bytes; use fewer environments, or a robot with fewer contact points");
    std::memset(p, 0, bytes_);
    data_.reset(static_cast<char*>(p));
  }
  char* data() const { return data_.get(); }
  std::size_t bytes() const { return bytes_; }
  explicit operator bool() const { return data_ != nullptr; }

 private:
  static constexpr std::size_t kLine = 64;
  struct Free {
    void operator()(char* p) const { ::operator delete(p, std::align_val_t(kLine)); }
  };
  std::unique_ptr<char, Free> data_;
  std::size_t bytes_ = 0;
};

}  // namespace stickslip::world
