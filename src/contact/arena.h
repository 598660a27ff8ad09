// Memory for arrays, handed out from one block.
#pragma once
#include "lane/lane.h"

namespace stickslip::contact::inline STICKSLIP_KERNELS {

/// Bump allocation over a block that the owner hands over; with no block it only counts.
class Arena {
 public:
  explicit Arena(void* memory) : base_(static_cast<char*>(memory)) {}
  template <class T>
  T* take(long n) {
    used_ = (used_ + 63) / 64 * 64;
    T* p = reinterpret_cast<T*>(base_ + used_);
    used_ += n * long(sizeof(T));
    return base_ ? p : nullptr;
  }
  long used() const { return used_ + 64; }

 private:
  char* base_;
  long used_ = 0;
};

}  // namespace stickslip::contact::inline STICKSLIP_KERNELS
