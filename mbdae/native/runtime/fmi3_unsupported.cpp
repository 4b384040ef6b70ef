// Functions of FMI 3.0 for features that exported mechanisms do not have.
#include "runtime/fmu_instance.hpp"

using namespace mbdae::fmi;

// There are no variables of other types, clocks or partitions; calls for zero variables succeed.
#define NO_VARIABLES(name)                                                                                      \
  FMI3 Status name(void* instance, References, size_t n) {                                                      \
    return n ? static_cast<Instance*>(instance)->report(error, #name ": all variables are of type Float64") : ok; \
  }
#define NO_VARIABLES_OF(type) NO_VARIABLES(fmi3Get##type) NO_VARIABLES(fmi3Set##type)
NO_VARIABLES_OF(Float32)
NO_VARIABLES_OF(Int8)
NO_VARIABLES_OF(UInt8)
NO_VARIABLES_OF(Int16)
NO_VARIABLES_OF(UInt16)
NO_VARIABLES_OF(Int32)
NO_VARIABLES_OF(UInt32)
NO_VARIABLES_OF(Int64)
NO_VARIABLES_OF(UInt64)
NO_VARIABLES_OF(Boolean)
NO_VARIABLES_OF(String)
NO_VARIABLES_OF(Binary)
NO_VARIABLES_OF(Clock)
NO_VARIABLES_OF(IntervalDecimal)
NO_VARIABLES_OF(IntervalFraction)
NO_VARIABLES_OF(ShiftDecimal)
NO_VARIABLES_OF(ShiftFraction)
NO_VARIABLES(fmi3GetOutputDerivatives)

#define UNSUPPORTED(name)                                                              \
  FMI3 Status name(void* instance) {                                                   \
    return static_cast<Instance*>(instance)->report(error, #name " is not supported"); \
  }
UNSUPPORTED(fmi3GetNumberOfVariableDependencies)
UNSUPPORTED(fmi3GetVariableDependencies)
UNSUPPORTED(fmi3ActivateModelPartition)
