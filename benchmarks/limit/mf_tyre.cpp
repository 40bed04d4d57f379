// Forces and moments of a batch of contacts, one array a quantity.
#include "mf_tyre.hpp"

namespace {

constexpr int inputs = 7, outputs = 5;

template <class S> void run(int count, const double *coefficients, const S *const *contacts, S *const *found) {
  // Two native vectors at once; see vector.hpp. One takes a fifth longer, though two spill registers.
  using P = Pack<S, 2>;
  MFTyre<S> tyre;
#define JV_FIELD(name) tyre.name = S(*coefficients++);
  JV_MF_COEFFICIENTS(JV_FIELD)
#undef JV_FIELD
  for (int j = 0; j < count; j += P::lanes) {
    const int here = count - j < P::lanes ? count - j : P::lanes;
    P x[inputs];
    if (here == P::lanes) {
      for (int i = 0; i < inputs; i++) x[i] = P::load(contacts[i] + j);
    } else {
      for (int i = 0; i < inputs; i++) {
        x[i] = P(1);
        std::memcpy(x[i].v, contacts[i] + j, here * sizeof(S));
      }
    }
    const Forces<P> f = forces(tyre, Contact<P>{x[0], x[1], x[2], x[3], x[4], x[5], x[6]});
    const P y[outputs] = {f.F_x, f.F_y, f.M_x, f.M_y, f.M_z};
    if (here == P::lanes)
      for (int i = 0; i < outputs; i++) y[i].store(found[i] + j);
    else
      for (int i = 0; i < outputs; i++) std::memcpy(found[i] + j, y[i].v, here * sizeof(S));
  }
}

}  // namespace

#define JV_NAME(name) #name " "
extern "C" const char *jaxveh_mf_tyre_names() { return JV_MF_COEFFICIENTS(JV_NAME); }
#undef JV_NAME

// `contacts`: slip angle, slip ratio, load, camber, friction, speed, pressure; `found`: F_x, F_y, M_x, M_y, M_z; (count,) each.
extern "C" void jaxveh_mf_tyre(int single, int count, const double *coefficients, const void *const *contacts, void *const *found) {
  if (single) run<float>(count, coefficients, (const float *const *)contacts, (float *const *)found);
  else run<double>(count, coefficients, (const double *const *)contacts, (double *const *)found);
}
