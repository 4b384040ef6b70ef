// Checks of the coefficients of methods, which also set derived fields.
#pragma once

#include "run/core.hpp"

namespace mbdae {

void complete_tableau(Tableau& t);
void complete_radau(Radau& r);
void complete_composition(Composition& c);
void complete_alpha(GeneralizedAlpha& a);

}  // namespace mbdae
