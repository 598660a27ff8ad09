// Exceptions of the public API. A step never throws; building a model or a world does.
#pragma once
#include <stdexcept>
#include <string>

namespace stickslip {

/// A robot description, a model or a contact problem is not usable. The text names the file,
/// element or argument, says what is wrong with it and what to do. Python sees a `ValueError`.
class ModelError : public std::invalid_argument {
 public:
  using std::invalid_argument::invalid_argument;
};

/// A file could not be opened or read. Python sees a `FileNotFoundError`.
class FileError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

}  // namespace stickslip
