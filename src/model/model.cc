#include <stickslip/errors.h>
#include <stickslip/model.h>

#include <numeric>

namespace stickslip {
namespace {

template <class Items>
std::string list_names(const Items& items) {
  std::string text;
  for (const auto& item : items) text += (text.empty() ? "'" : ", '") + item.name + "'";
  return text.empty() ? "none" : text;
}

template <class Items>
int find(const Items& items, const std::string& name) {
  for (size_t i = 0; i < items.size(); ++i)
    if (items[i].name == name) return static_cast<int>(i);
  return -1;
}

}  // namespace

double Model::mass() const {
  const auto first = bodies_.begin() + (base_ == BaseType::kFixed ? 1 : 0);
  return std::accumulate(first, bodies_.end(), 0.0,
                         [](double sum, const Body& body) { return sum + body.inertial.mass; });
}

int Model::joint_index(const std::string& name) const {
  const int index = find(joints_, name);
  if (index < 0)
    throw ModelError("robot '" + name_ + "' has no moving joint '" + name + "'; it has " +
                     list_names(joints_));
  return index;
}

int Model::body_index(const std::string& name) const {
  const int index = find(bodies_, name);
  if (index >= 0) return index;
  const int merged = find(frames_, name);
  if (merged >= 0)
    throw ModelError("link '" + name + "' of robot '" + name_ + "' is fixed to body '" +
                     bodies_[frames_[merged].body].name +
                     "'; ask for that body, or for the frame '" + name + "'");
  throw ModelError("robot '" + name_ + "' has no body '" + name + "'; it has " +
                   list_names(bodies_));
}

const Frame& Model::frame(const std::string& name) const {
  const int index = find(frames_, name);
  if (index < 0)
    throw ModelError("robot '" + name_ + "' has no frame '" + name + "'; it has " +
                     list_names(frames_));
  return frames_[index];
}

}  // namespace stickslip
