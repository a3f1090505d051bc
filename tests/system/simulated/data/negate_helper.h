template <class T>
T opposite(T value) {
    return static_cast<T>(~value);
}

float opposite(float value);
double opposite(double value);
