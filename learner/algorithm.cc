#include "learner/algorithm.h"

namespace dbr {

std::string AlgorithmName(const AlgorithmConfig& config) {
  const google::protobuf::Reflection* reflection = AlgorithmConfig::GetReflection();
  const google::protobuf::FieldDescriptor* field = reflection->GetOneofFieldDescriptor(
      config, AlgorithmConfig::descriptor()->FindOneofByName("algorithm"));
  return field == nullptr ? "" : field->name();
}

}  // namespace dbr
