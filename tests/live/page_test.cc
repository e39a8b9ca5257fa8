#include "live/detail/page.h"

#include <string>

#include <gtest/gtest.h>

namespace crosstie::live::detail {
namespace {

TEST(PagePolicy, NamesTheInlineBlocksAndNothingElse) {
  // Hashes by: printf 'CONTENT' | openssl dgst -sha256 -binary | base64
  const std::string policy =
      page_policy("<html><style>p{}</style><script type=\"module\">var a='<style>b</style>'</script><script></script></html>");
  EXPECT_EQ(policy,
            "default-src 'none'; script-src 'sha256-7yQFyXGO309FGaJq/Dv8mXPSfvUIhgq+F/PWuCaxLSA=' "
            "'sha256-47DEQpj8HBSa+/TImW+5JCeuQeRkm5NMpJWZG3hSuFU='; style-src "
            "'sha256-gG2yISYereRMiG2lMXrbiUgi0Ubw9p7QCeWcroOvy9Y='; img-src 'self' data: blob:; connect-src 'self'; base-uri "
            "'none'; form-action 'none'; "
            "frame-ancestors 'none'");
}

TEST(PagePolicy, APageWithoutScriptsRunsNone) {
  const std::string policy = page_policy("<p>x</p>");
  EXPECT_NE(policy.find("script-src 'none'; style-src 'none';"), std::string::npos) << policy;
}

TEST(PagePolicy, ThePageIsOneFile) {
  const std::string_view page = index_html();
  EXPECT_TRUE(page.starts_with("<!doctype html>") || page.starts_with("<!DOCTYPE html>"));
  for (const char* outside : {"<script src", "<link", "@import", "<iframe", "<base"}) {
    EXPECT_EQ(page.find(outside), std::string_view::npos) << outside;
  }
  EXPECT_NE(page_policy(page).find("script-src 'sha256-"), std::string::npos);
}

}  // namespace
}  // namespace crosstie::live::detail
