#pragma once

#include <span>
#include <string>
#include <string_view>

namespace crosstie::report::detail {

/// Numbers for people, always with a decimal point, whatever the locale. What is not finite reads "n/a".

/// With a fixed number of decimals; never "-0.00".
std::string fixed(double value, int decimals);

/// With so many significant digits, without an exponent between 1e-4 and 1e7.
std::string significant(double value, int digits = 3);

/// Significant digits without trailing zeros: for values that people set, like limits.
std::string plain(double value, int digits = 4);

/// "= 0.021", or "< 0.0001" where it is smaller: what stands after "p".
std::string probability(double p);

/// A count with thin spaces between thousands: "19 945".
std::string counted(long long value);

/// The decimals at which `sigma` shows two significant digits, 0 to 9; `otherwise` where there is no positive finite sigma.
int decimals_for_sigma(double sigma, int otherwise = 3);

/// Decimals for a whole column: two digits of its smaller sigmas, so that columns align and no sigma reads 0.
int decimals_for_column(std::span<const double> sigmas, int otherwise = 3);

/// A value with its standard uncertainty: "1000.0042 ± 0.0018 mm".
std::string with_sigma(double value, double sigma, std::string_view unit);

/// Its expanded uncertainty: "U = 0.0036 mm". Empty where there is no sigma.
std::string expanded(double sigma, std::string_view unit);

/// Lengths that are small beside a millimetre are shown in micrometres.
struct LengthUnit {
  double per_mm = 1.0;
  const char* name = "mm";
};

/// Micrometres where the typical one of these lengths is below 0.1 mm.
LengthUnit unit_for_lengths(std::span<const double> lengths_mm);

double median(std::span<const double> values);

}  // namespace crosstie::report::detail
