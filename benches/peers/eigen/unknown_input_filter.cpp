// The zonotopic unknown-input filter with a fixed gain (method sheet `unknown_input_filter`, 4.2 and 4.3) with Eigen,
// as somebody would write it who knows the sizes when compiling: 4 states, 3 outputs, 1 unknown input, 40 generators.
//
// One product with the stacked matrix [(I - LC); WC; phi C] A0 gives the corrected generators and the spread of all
// test rows. All matrices have a fixed size; while the set still grows to its 40 generators the product runs over a
// block. See contender.rs for the lines `check` and `time`.

#include <Eigen/Core>
#include <Eigen/LU>
#include <Eigen/QR>
#include <algorithm>
#include <array>
#include <cstdio>
#include <ctime>
#include <fstream>
#include <iostream>
#include <map>
#include <sstream>
#include <string>
#include <vector>

constexpr int NX = 4, NY = 3, NU = 1, ORDER = 40;
constexpr int ROWS = NY + NU;                // test rows and estimates
constexpr int ALL = NX + ROWS;               // rows of the stacked matrix
constexpr int COLUMNS = ORDER + NX + NY;     // generators before the reduction
constexpr int KEPT = ORDER - NX;

template <int R, int C> using Matrix = Eigen::Matrix<double, R, C, R == 1 || C != 1 ? Eigen::RowMajor : Eigen::ColMajor>;
template <int R> using Vector = Eigen::Matrix<double, R, 1>;

// The numbers of a matrix, row by row.
struct Numbers {
    int rows = 0, columns = 0;
    std::vector<double> values;

    template <int R, int C> operator Matrix<R, C>() const {
        return Eigen::Map<const Eigen::Matrix<double, R, C, C == 1 ? Eigen::ColMajor : Eigen::RowMajor>>(values.data());
    }
    template <int R> Vector<R> row(int i) const { return Eigen::Map<const Vector<R>>(values.data() + i * columns); }
};
using Named = std::map<std::string, Numbers>;

static Named read(const char *path) {
    Named named;
    std::ifstream file(path);
    for (std::string line; std::getline(file, line);) {
        std::istringstream words(line);
        std::string name;
        Numbers numbers;
        words >> name >> numbers.rows >> numbers.columns;
        for (double value; words >> value;) numbers.values.push_back(value);
        named[name] = numbers;
    }
    return named;
}

class Filter {
public:
    explicit Filter(Named &problem)
        : a_(problem["A"]), b_(problem["B"]), c_(problem["C"]), a_plus_(problem["A_uncertainty"]),
          w_(problem["disturbance"].row<NX>(0)), v_(problem["noise"].row<NY>(0)), p0_(problem["centre"].row<NX>(0)),
          h0_(problem["radius"].row<NX>(0)), gain_(problem["L_fix"]) {
        // Off-line: the decoupled test rows and the row of the estimate for the settled spread.
        const Matrix<NY, NU> cf = c_ * b_;
        const Matrix<NU, NY> left_inverse = (cf.transpose() * cf).inverse() * cf.transpose();
        const Matrix<NY, NY> projector = Matrix<NY, NY>::Identity() - cf * left_inverse;
        const Matrix<NY, NY> complete = Eigen::HouseholderQR<Matrix<NY, NU>>(cf).householderQ();
        const Matrix<NY, NY - NU> basis = complete.template rightCols<NY - NU>();
        rows_.template topRows<NY>() = projector;
        rows_.template bottomRows<NU>().setZero();
        prepare();
        reset();
        Matrix<NY, NY> psi;
        for (int step = 0; step < 2000; ++step) {
            state_.setZero();
            box_ = a_plus_ * radius_ + w_;
            const Matrix<NY, NX> boxed = c_ * box_.asDiagonal();
            psi = boxed * boxed.transpose();
            psi += v_.array().square().matrix().asDiagonal();
            for (int i = 0; i < count_; ++i) {
                const Vector<NY> spread = c_ * (a_ * generators_.col(i));
                psi += spread * spread.transpose();
            }
            advance_set();
        }
        const Matrix<NY - NU, NY - NU> k = basis.transpose() * psi * basis;
        rows_.template bottomRows<NU>() = left_inverse - left_inverse * psi * basis * k.inverse() * basis.transpose();
        prepare();
    }

    void reset() {
        started_ = false;
        generators_.setZero();
        generators_.template leftCols<NX>() = h0_.asDiagonal();
        radius_ = h0_;
        count_ = NX;
        state_ = p0_;
        residuals_.setZero();
        bounds_.setZero();
    }

    void step(const Vector<NY> &y, const Vector<NU> &u) {
        if (!started_) {
            // Instant 0 gives the command of the first transition only.
            started_ = true;
            command_ = u;
            return;
        }
        box_.noalias() = a_plus_ * (state_.cwiseAbs() + radius_) + w_;
        const Vector<NX> centre = a_ * state_ + b_ * command_;
        const Vector<NY> innovation = y - c_ * centre;
        residuals_.noalias() = rows_ * innovation;
        state_.noalias() = centre + gain_ * innovation;
        command_ = u;
        advance_set();
        bounds_.template tail<NU>() += residuals_.template tail<NU>();
    }

    void append(std::vector<double> &out) const {
        out.insert(out.end(), residuals_.data(), residuals_.data() + ROWS);
        out.insert(out.end(), bounds_.data(), bounds_.data() + ROWS);
    }

private:
    void prepare() {
        weights_.template topRows<NX>() = gain_;
        weights_.template bottomRows<ROWS>() = rows_;
        maps_ = -weights_ * c_;
        maps_.template bottomRows<ROWS>() *= -1.0;
        maps_.template topRows<NX>() += Matrix<NX, NX>::Identity();
        stacked_ = maps_ * a_;
        magnitudes_ = maps_.template bottomRows<ROWS>().cwiseAbs();
        noise_ = gain_ * v_.asDiagonal();
        constant_ = rows_.cwiseAbs() * v_;
    }

    // H and the half widths of all rows from H, box_ and the constants.
    void advance_set() {
        if (count_ == ORDER) {
            // Not `stacked_ * generators_`: above 20 rows, columns and terms Eigen packs blocks, which costs more here.
            product_.noalias() = stacked_.lazyProduct(generators_);
            bounds_ = product_.template bottomRows<ROWS>().cwiseAbs().rowwise().sum() + magnitudes_ * box_ + constant_;
            wide_.template leftCols<ORDER>() = product_.template topRows<NX>();
            wide_.template middleCols<NX>(ORDER) = maps_.template topRows<NX>() * box_.asDiagonal();
            wide_.template rightCols<NY>() = noise_;
            reduce();
            return;
        }
        // While the set still grows.
        bounds_ = magnitudes_ * box_ + constant_;
        wide_.setZero();
        for (int i = 0; i < count_; ++i) {
            const Vector<ALL> product = stacked_ * generators_.col(i);
            bounds_ += product.template tail<ROWS>().cwiseAbs();
            wide_.col(i) = product.template head<NX>();
        }
        wide_.template middleCols<NX>(count_) = maps_.template topRows<NX>() * box_.asDiagonal();
        wide_.template middleCols<NY>(count_ + NX) = noise_;
        count_ += NX + NY;
        if (count_ > ORDER) {
            count_ = ORDER;
            reduce();
            return;
        }
        generators_ = wide_.template leftCols<ORDER>();
        radius_ = wide_.cwiseAbs().rowwise().sum();
    }

    // Theorem 3: the KEPT columns of largest scaled score stay in their order, the others become a box. Columns of
    // zeros score lowest and add nothing.
    void reduce() {
        const Matrix<NX, COLUMNS> sizes = wide_.cwiseAbs();
        radius_ = sizes.rowwise().sum();
        const Matrix<NX, COLUMNS> scaled = radius_.cwiseInverse().asDiagonal() * sizes;
        const Matrix<1, COLUMNS> scores = scaled.colwise().sum() - scaled.colwise().maxCoeff();
        std::array<int, COLUMNS> order;
        for (int i = 0; i < COLUMNS; ++i) order[i] = i;
        std::nth_element(order.begin(), order.begin() + KEPT, order.end(), [&](int left, int right) {
            return scores[left] > scores[right] || (scores[left] == scores[right] && left < right);
        });
        std::array<bool, COLUMNS> keep{};
        for (int i = 0; i < KEPT; ++i) keep[order[i]] = true;
        Vector<NX> rest = Vector<NX>::Zero();
        int next = 0;
        for (int i = 0; i < COLUMNS; ++i) {
            if (keep[i])
                generators_.col(next++) = wide_.col(i);
            else
                rest += sizes.col(i);
        }
        generators_.template rightCols<NX>() = rest.asDiagonal();
    }

    Matrix<NX, NX> a_;
    Matrix<NX, NU> b_;
    Matrix<NY, NX> c_;
    Matrix<NX, NX> a_plus_;
    Vector<NX> w_;
    Vector<NY> v_;
    Vector<NX> p0_, h0_;
    Matrix<NX, NY> gain_;
    Matrix<ROWS, NY> rows_;
    Matrix<ALL, NY> weights_;
    Matrix<ALL, NX> maps_, stacked_;
    Matrix<ROWS, NX> magnitudes_;
    Matrix<NX, NY> noise_;
    Vector<ROWS> constant_;

    bool started_ = false;
    int count_ = NX;
    Matrix<NX, ORDER> generators_;
    Vector<NX> state_, radius_, box_;
    Vector<NU> command_;
    Matrix<ALL, ORDER> product_;
    Matrix<NX, COLUMNS> wide_;
    Vector<ROWS> residuals_, bounds_;
};

// What this thread has used of a processor, nanoseconds.
static long long processor_time() {
    timespec time;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
    return time.tv_sec * 1'000'000'000LL + time.tv_nsec;
}

int main(int, char **arguments) {
    Named problem = read(arguments[1]);
    Filter filter(problem);
    std::vector<Vector<NY>> measurements;
    std::vector<Vector<NU>> commands;
    for (int k = 0; k < problem["measurements"].rows; ++k) {
        measurements.push_back(problem["measurements"].row<NY>(k));
        commands.push_back(problem["commands"].row<NU>(k));
    }
    const auto pass = [&] {
        filter.reset();
        const long long begin = processor_time();
        for (std::size_t k = 0; k < measurements.size(); ++k) {
            filter.step(measurements[k], commands[k]);
            asm volatile("" : : "r"(&filter) : "memory");
        }
        return processor_time() - begin;
    };
    std::printf("Eigen %d.%d.%d, g++ %s %s\n", EIGEN_WORLD_VERSION, EIGEN_MAJOR_VERSION, EIGEN_MINOR_VERSION,
                __VERSION__, arguments[2]);
    std::fflush(stdout);
    for (std::string line; std::getline(std::cin, line);) {
        if (line != "check") {
            pass();
            std::printf("%lld\n", pass());
            std::fflush(stdout);
            continue;
        }
        filter.reset();
        for (std::size_t k = 0; k < measurements.size(); ++k) {
            filter.step(measurements[k], commands[k]);
            std::vector<double> numbers;
            filter.append(numbers);
            std::printf(k == 0 ? "[[" : ",[");
            for (std::size_t i = 0; i < numbers.size(); ++i) std::printf(i == 0 ? "%.17g" : ",%.17g", numbers[i]);
            std::printf("]");
        }
        std::printf("]\n");
        std::fflush(stdout);
    }
}
