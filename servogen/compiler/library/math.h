#define fabs(x) __fabs(x)
#define fabsf(x) __fabs(x)
#define floorf(x) floor(x)
#define ceilf(x) ceil(x)
#define sqrt(x) __sqrt(x)
#define sqrtf(x) __sqrt(x)
float floor(float x);
float ceil(float x);
