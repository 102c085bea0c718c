#define fabs(x) __fabs(x)
#define fabsf(x) __fabs(x)
#define floorf(x) floor(x)
#define ceilf(x) ceil(x)
float floor(float x);
float ceil(float x);
