// Frequency response of a blade sector, frequency by frequency, from C++.
//
//    frf_cpp sector.dat result.txt [points after which to stop]
//
// The lines written are those of frf.c. A class owns the handle and turns statuses into
// exceptions; the callback throws nothing, since it is called through the library.
#include <fretwear.h>

#include <cstdio>
#include <fstream>
#include <iomanip>
#include <iostream>
#include <map>
#include <stdexcept>
#include <string>
#include <vector>

class Session {
public:
   Session()
   {
      if (fw_create(&handle_) != FW_OK) throw std::runtime_error("no memory for a handle");
   }
   ~Session() { fw_destroy(handle_); }
   Session(const Session &) = delete;
   Session &operator=(const Session &) = delete;

   fw_handle get() const { return handle_; }

   // The status, where it is one of success or of a point that is there all the same.
   int check(int status) const
   {
      if (status == FW_OK || status == FW_NOT_CONVERGED || status == FW_STOPPED) return status;
      std::string text(fw_get_message(handle_, nullptr, 0), '\0');
      fw_get_message(handle_, &text[0], text.size() + 1);
      throw std::runtime_error(text);
   }

   void set(const std::string &key, const std::string &value) const
   {
      check(fw_set(handle_, key.c_str(), value.c_str()));
   }
   void put(const char *name, const std::vector<double> &values) const
   {
      check(fw_put_reals(handle_, name, values.size(), values.data()));
   }
   void put(const char *name, const std::vector<int> &values) const
   {
      check(fw_put_integers(handle_, name, values.size(), values.data()));
   }
   int count(const char *what) const
   {
      int n = 0;
      check(fw_count(handle_, what, &n));
      return n;
   }
   std::vector<double> values(const char *name, int point = -1) const
   {
      std::size_t n = 0;
      check(fw_size(handle_, name, point, &n));
      std::vector<double> result(n);
      check(fw_get(handle_, name, point, n, result.data()));
      return result;
   }

private:
   fw_handle handle_ = nullptr;
};

template <typename Number> std::vector<Number> read(std::istream &in, std::size_t n)
{
   std::vector<Number> values(n);
   for (auto &value : values)
      if (!(in >> value)) throw std::runtime_error("the model file is too short");
   return values;
}

static void read_model(const char *path, const Session &session)
{
   std::ifstream in(path);
   std::size_t n_dof = 0, n_pairs = 0;
   if (!(in >> n_dof >> n_pairs)) throw std::runtime_error("cannot read the model");
   session.check(fw_new_model(session.get(), int(n_dof), int(n_pairs)));
   for (auto name : {"mass", "stiffness", "stiffness_rotation"})
      session.put(name, read<double>(in, n_dof * n_dof));
   for (auto name : {"load/static", "load/static_rotation", "load/cosine", "load/sine"})
      session.put(name, read<double>(in, n_dof));
   for (auto name : {"contact/mu", "contact/gap", "contact/area"})
      session.put(name, read<double>(in, n_pairs));
   for (auto name : {"contact/side_1", "contact/side_2"})
      session.put(name, read<int>(in, 3 * n_pairs));
   const auto tip = read<double>(in, n_dof);
   session.check(fw_observe(session.get(), "tip", tip.size(), tip.data()));
}

extern "C" int report(void *user, const fw_progress *p)
{
   const int stop_after = *static_cast<const int *>(user);
   std::fprintf(stderr, "point %d: %.3f rad/s\n", p->point, p->omega);
   return stop_after > 0 && p->point + 1 >= stop_after;
}

int main(int argc, char **argv)
try {
   if (argc < 3) return FW_USAGE;
   int stop_after = argc > 3 ? std::stoi(argv[3]) : 0;
   const Session session;
   read_model(argv[1], session);
   const std::map<std::string, std::string> keys = {
      {"model%modal_damping", "1e-3"}, {"model%rotation_speed", "460.8"},
      {"contact%law", "dlft"},         {"load%harmonic_scale", "0.5"},
      {"harmonics%n_harmonics", "3"},  {"harmonics%n_time", "128"},
      {"sweep%unit", "Hz"},            {"sweep%start", "1017"},
      {"sweep%end", "1029"},           {"sweep%n_points", "25"}};
   for (const auto &key : keys) session.set(key.first, key.second);
   session.check(fw_on_progress(session.get(), report, &stop_after));

   std::ofstream out(argv[2]);
   out << std::setprecision(17);
   session.check(fw_start(session.get()));
   const int n_points = session.count("frequencies");
   int status = FW_OK;
   for (int k = 0; k < n_points && status != FW_STOPPED; k++) {
      double omega = 0;
      session.check(fw_get_frequency(session.get(), k, &omega));
      status = session.check(fw_solve(session.get(), omega));
      for (auto name : {"omega", "converged", "amplitude", "coefficients", "contact/force",
                        "contact/fraction", "contact/dissipation"})
         for (double value : session.values(name)) out << value << ' ';
      out << '\n';
   }
   return status;
} catch (const std::exception &error) {
   std::cerr << error.what() << '\n';
   return FW_FAILURE;
}
